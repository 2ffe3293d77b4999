#include "capture/frames/picture_layout.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <new>

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

struct Rgb {
  double r, g, b;
};

// red, blue: their shares in luma
Rgb rgb_of(double y, double u, double v, double red, double blue, ColorRange range) {
  const bool is_full = range == ColorRange::full;
  y = is_full ? y : (y - 16) * 255 / 219, u = (u - 128) * (is_full ? 1 : 255. / 224);
  v = (v - 128) * (is_full ? 1 : 255. / 224);
  const double r = y + 2 * (1 - red) * v, b = y + 2 * (1 - blue) * u;
  return {r, (y - red * r - blue * b) / (1 - red - blue), b};
}

void expect_color(const Image& image, int u, int v, const Rgb& expected) {
  const Yuv yuv = yuv_at(image, u, v);
  const Rgb shown = rgb_of(yuv.y, yuv.u, yuv.v, 0.299, 0.114, image.range);  // ITU-R BT.601
  EXPECT_NEAR(shown.r, expected.r, 2) << name(image.format) << u << ' ' << v;
  EXPECT_NEAR(shown.g, expected.g, 2) << name(image.format) << u << ' ' << v;
  EXPECT_NEAR(shown.b, expected.b, 2) << name(image.format) << u << ' ' << v;
}

FramePtr frame_of(AVPixelFormat format, AVColorSpace matrix, AVColorRange range, int size) {
  FramePtr frame(not_null(av_frame_alloc()));
  frame->format = format, frame->colorspace = matrix, frame->color_range = range;
  frame->width = frame->height = size;
  if (av_frame_get_buffer(frame.get(), 0) != 0) throw std::bad_alloc();
  return frame;
}

// Pixels that share a colour still do.
TEST(PictureMaker, WholePicturesOfAnotherMatrixBecomeBgr) {
  constexpr int size = 16;
  struct Matrix {
    AVColorSpace tag;
    double red, blue;
  };
  struct Format {
    AVPixelFormat tag;
    int shared_columns, shared_rows;
  };
  for (const Matrix& matrix : {Matrix{AVCOL_SPC_BT709, 0.2126, 0.0722}, Matrix{AVCOL_SPC_BT2020_NCL, 0.2627, 0.0593}})
    for (const ColorRange range : {ColorRange::limited, ColorRange::full})
      for (const Format& format : {Format{AV_PIX_FMT_YUV420P, 2, 2}, Format{AV_PIX_FMT_YUV422P, 2, 1},
                                   Format{AV_PIX_FMT_YUV444P, 1, 1}, Format{AV_PIX_FMT_NV12, 2, 2}}) {
        FramePtr frame =
            frame_of(format.tag, matrix.tag, range == ColorRange::full ? AVCOL_RANGE_JPEG : AVCOL_RANGE_MPEG, size);
        const auto v_of = [&](int x, int y) {
          return 90 + 20 * ((x / format.shared_columns + y / format.shared_rows) % 5);
        };
        const bool is_nv12 = format.tag == AV_PIX_FMT_NV12;
        for (int y = 0; y < size; ++y)
          for (int x = 0; x < size; ++x) {
            const int color_x = x / format.shared_columns, color_y = y / format.shared_rows;
            frame->data[0][y * frame->linesize[0] + x] = 120;
            std::uint8_t* u = frame->data[1] + color_y * frame->linesize[1] + (is_nv12 ? 2 : 1) * color_x;
            std::uint8_t* v = is_nv12 ? u + 1 : frame->data[2] + color_y * frame->linesize[2] + color_x;
            *u = 112, *v = static_cast<std::uint8_t>(v_of(x, y));
          }
        PictureMaker maker;
        const auto image = maker.image_of(std::move(frame), AV_CODEC_ID_H264);
        ASSERT_TRUE(image);
        ASSERT_EQ(image->format, PixelFormat::bgr);
        for (int y = 0; y < size; ++y)
          for (int x = 0; x < size; ++x) {
            const std::uint8_t* const bgr = image->planes[0].data + y * image->planes[0].stride + 3 * x;
            const Rgb expected = rgb_of(120, 112, v_of(x, y), matrix.red, matrix.blue, range);
            EXPECT_NEAR(bgr[2], expected.r, 2) << x << ' ' << y;
            EXPECT_NEAR(bgr[1], expected.g, 2) << x << ' ' << y;
            EXPECT_NEAR(bgr[0], expected.b, 2) << x << ' ' << y;
          }
      }
}

// A row of 4:2:0's colours belongs to every second row of the picture, four of which it spans.
TEST(PictureMaker, FieldsKeepTheirOwnColours) {
  constexpr int size = 16;
  for (const bool is_whole : {true, false})
    for (const AVPixelFormat format : {AV_PIX_FMT_YUV420P, AV_PIX_FMT_NV12, AV_PIX_FMT_YUV422P}) {
      FramePtr frame = frame_of(format, AVCOL_SPC_BT709, AVCOL_RANGE_MPEG, size);
      frame->interlaced_frame = frame->top_field_first = 1;
      const Yuv fields[] = {{150, 90, 110}, {100, 120, 190}};
      const bool is_nv12 = format == AV_PIX_FMT_NV12;
      for (int y = 0; y < size; ++y) std::fill_n(frame->data[0] + y * frame->linesize[0], size, fields[y % 2].y);
      for (int y = 0; y < (format == AV_PIX_FMT_YUV422P ? size : size / 2); ++y)
        for (int x = 0; x < size / 2; ++x) {
          std::uint8_t* u = frame->data[1] + y * frame->linesize[1] + (is_nv12 ? 2 : 1) * x;
          *u = fields[y % 2].u, *(is_nv12 ? u + 1 : frame->data[2] + y * frame->linesize[2] + x) = fields[y % 2].v;
        }
      PictureMaker maker;
      if (is_whole) maker.keep_fields(false);
      const auto image = maker.image_of(std::move(frame), AV_CODEC_ID_H264);
      ASSERT_TRUE(image);
      for (const FirstField field : {FirstField::top, FirstField::bottom}) {
        if (!is_whole && field == FirstField::bottom) continue;
        const Image played = is_whole ? first_field(*image, field) : *image;
        const Yuv& own = fields[field == FirstField::top ? 0 : 1];
        for (int y = 0; y < size; ++y)
          expect_color(played, y, y, rgb_of(own.y, own.u, own.v, 0.2126, 0.0722, ColorRange::limited));
      }
    }
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
