#include "capture/frames/picture_layout.h"

#include <gmock/gmock.h>

#include "capture/ffmpeg/ffmpeg_objects.h"
#include "capture/ffmpeg/ffmpeg_picture.h"

namespace huetrack::capture {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr PixelFormat turned_formats[] = {PixelFormat::yuyv, PixelFormat::nv12, PixelFormat::i420, PixelFormat::i422,
                                          PixelFormat::i444, PixelFormat::bgr,  PixelFormat::grey};

// Every byte another.
Image picture(PixelFormat format, int width = 8, int height = 6) {
  WritableImage made = make_image(format, ColorRange::full, width, height);
  std::uint8_t value = 0;
  for (int plane = 0; plane < 3; ++plane)
    for (std::size_t i = 0, n = plane_row_bytes(format, plane, width) * std::size_t(plane_rows(format, plane, height));
         i < n; ++i)
      made.data[std::size_t(plane)][i] = value = std::uint8_t(value + 37);
  return made.image;
}

int first_component(const Image& image, int u, int v) {
  return image.format == PixelFormat::bgr ? bgr_at(image, u, v).b : yuv_at(image, u, v).y;
}

// Four pixels share a colour, converted or not.
TEST(PictureMaker, ConvertedPicturesKeepTheirColoursInPlace) {
  constexpr int size = 16;
  FramePtr frame(not_null(av_frame_alloc()));
  frame->format = AV_PIX_FMT_YUV420P;
  frame->colorspace = AVCOL_SPC_BT709;
  frame->width = frame->height = size;
  ASSERT_EQ(av_frame_get_buffer(frame.get(), 0), 0);
  const auto v_of = [](int x, int y) { return 90 + 20 * ((x / 2 + y / 2) % 5); };
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) {
      frame->data[0][y * frame->linesize[0] + x] = 120;
      frame->data[1][y / 2 * frame->linesize[1] + x / 2] = 128;
      frame->data[2][y / 2 * frame->linesize[2] + x / 2] = static_cast<std::uint8_t>(v_of(x, y));
    }
  PictureMaker maker;
  const auto image = maker.image_of(std::move(frame), AV_CODEC_ID_H264);
  ASSERT_TRUE(image);
  ASSERT_EQ(image->format, PixelFormat::bgr);
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x)  // ITU-R BT.709, limited range
      EXPECT_NEAR(bgr_at(*image, x, y).r, 1.164 * (120 - 16) + 1.793 * (v_of(x, y) - 128), 2) << x << ' ' << y;
}

TEST(PictureLayout, TurnsEveryFormatByEveryTag) {
  for (const PixelFormat format : turned_formats)
    for (unsigned tag = 1; tag <= 8; ++tag) {
      const Image from = picture(format);
      const Image to = turned(from, *orientation_of_tag(tag));
      ASSERT_EQ(to.width, tag <= 4 ? from.width : from.height);
      for (int v = 0; v < to.height; ++v)
        for (int u = 0; u < to.width; ++u) {
          // EXIF 2.32: which corner of the stored picture row 0 and column 0 show.
          const int right = from.width - 1, bottom = from.height - 1;
          const std::pair<int, int> stored = tag == 1   ? std::pair(u, v)
                                             : tag == 2 ? std::pair(right - u, v)
                                             : tag == 3 ? std::pair(right - u, bottom - v)
                                             : tag == 4 ? std::pair(u, bottom - v)
                                             : tag == 5 ? std::pair(v, u)
                                             : tag == 6 ? std::pair(v, bottom - u)
                                             : tag == 7 ? std::pair(right - v, bottom - u)
                                                        : std::pair(right - v, u);
          EXPECT_EQ(first_component(to, u, v), first_component(from, stored.first, stored.second))
              << name(format) << " tag " << tag << " at " << u << "," << v;
          if (format == PixelFormat::bgr) continue;
          EXPECT_EQ(yuv_at(to, u, v).u, yuv_at(from, stored.first, stored.second).u) << name(format) << tag;
          EXPECT_EQ(yuv_at(to, u, v).v, yuv_at(from, stored.first, stored.second).v) << name(format) << tag;
        }
    }
  EXPECT_EQ(orientation_of_tag(0), std::nullopt);
  EXPECT_EQ(orientation_of_tag(9), std::nullopt);
}

TEST(PictureLayout, AFieldsRowsStayAndTheOthersAreInterpolated) {
  const Image from = picture(PixelFormat::grey);
  for (const bool is_top_first : {true, false}) {
    const Image to = first_field(from, is_top_first ? FirstField::top : FirstField::bottom);
    for (int v = 0; v < from.height; ++v) {
      const bool is_own = (v % 2 == 0) == is_top_first;
      const int above = v > 0 ? v - 1 : v + 1, below = v + 1 < from.height ? v + 1 : v - 1;
      for (int u = 0; u < from.width; ++u)
        EXPECT_EQ(yuv_at(to, u, v).y,
                  is_own ? yuv_at(from, u, v).y : (yuv_at(from, u, above).y + yuv_at(from, u, below).y + 1) / 2);
    }
  }
}

TEST(PictureLayout, NotesSayWhatIsDone) {
  EXPECT_THAT(notes_on({}), IsEmpty());
  EXPECT_THAT(notes_on({.orientation = {-1, 0, 0, -1}, .turned_deg = 180}),
              ElementsAre(HasSubstr("turned by 180 degrees")));
  EXPECT_THAT(notes_on({.turned_deg = 12}), ElementsAre(HasSubstr("used as stored")));
  EXPECT_THAT(notes_on({.is_interlaced = true, .pixel_aspect = 4. / 3}),
              ElementsAre(HasSubstr("interlaced"), HasSubstr("1.333 : 1")));
}

}  // namespace
}  // namespace huetrack::capture
