#include "capture/frames/pixel_format.h"

#include <gmock/gmock.h>

#include <set>
#include <stdexcept>

namespace huetrack::capture {
namespace {

constexpr std::array all_formats{PixelFormat::yuyv, PixelFormat::nv12, PixelFormat::i420, PixelFormat::i422,
                                 PixelFormat::i444, PixelFormat::bgr,  PixelFormat::grey};

TEST(PixelFormat, EachHasAName) {
  std::set<std::string_view> names;
  for (const PixelFormat format : all_formats) names.insert(name(format));
  EXPECT_EQ(names.size(), all_formats.size());
  EXPECT_EQ(name(PixelFormat::i422), "i422");
}

// Every byte of a 4x2 image has its own value, so that a wrong address shows.
struct Counted : WritableImage {
  explicit Counted(PixelFormat format) : WritableImage(make_image(format, ColorRange::full, 4, 2)) {
    std::uint8_t value = 0;
    for (int plane = 0; plane < 3; ++plane)
      for (std::size_t i = 0;
           i < plane_row_bytes(format, plane, 4) * static_cast<std::size_t>(plane_rows(format, plane, 2)); ++i)
        data[static_cast<std::size_t>(plane)][i] = value++;
  }
  std::array<int, 3> yuv(int u, int v) const {
    const Yuv p = yuv_at(image, u, v);
    return {p.y, p.u, p.v};
  }
};

using testing::ElementsAre;

TEST(PixelFormat, YuyvIsPackedInPairs) {
  const Counted image(PixelFormat::yuyv);  // Y0 U Y1 V; 8 bytes a row
  EXPECT_THAT(image.yuv(0, 0), ElementsAre(0, 1, 3));
  EXPECT_THAT(image.yuv(1, 0), ElementsAre(2, 1, 3));
  EXPECT_THAT(image.yuv(3, 1), ElementsAre(14, 13, 15));
}

TEST(PixelFormat, Nv12HasInterleavedChromaForFourPixels) {
  const Counted image(PixelFormat::nv12);  // 8 Y, then U V U V
  EXPECT_THAT(image.yuv(1, 1), ElementsAre(5, 8, 9));
  EXPECT_THAT(image.yuv(2, 0), ElementsAre(2, 10, 11));
}

TEST(PixelFormat, PlanarFormatsDifferInTheSizeOfChroma) {
  EXPECT_THAT(Counted(PixelFormat::i420).yuv(3, 1), ElementsAre(7, 9, 11));
  EXPECT_THAT(Counted(PixelFormat::i422).yuv(3, 1), ElementsAre(7, 11, 15));
  EXPECT_THAT(Counted(PixelFormat::i444).yuv(3, 1), ElementsAre(7, 15, 23));
  EXPECT_THAT(Counted(PixelFormat::grey).yuv(3, 1), ElementsAre(7, 128, 128));
}

TEST(PixelFormat, BgrIsPacked) {
  const Counted image(PixelFormat::bgr);
  const Bgr pixel = bgr_at(image.image, 1, 1);
  EXPECT_THAT((std::array<int, 3>{pixel.b, pixel.g, pixel.r}), ElementsAre(15, 16, 17));
  EXPECT_EQ(image.image.range, ColorRange::full);
}

TEST(PixelFormat, StridesMayBeNegative) {
  Counted image(PixelFormat::i444);
  for (auto& plane : image.image.planes) plane = {plane.data + plane.stride, -plane.stride};
  EXPECT_THAT(image.yuv(0, 0), ElementsAre(4, 12, 20));
  EXPECT_THAT(image.yuv(0, 1), ElementsAre(0, 8, 16));
}

TEST(PixelFormat, MakeImageIsZeroedAndTight) {
  for (const PixelFormat format : all_formats) {
    const WritableImage made = make_image(format, ColorRange::limited, 6, 4);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(made.image.planes[i].data, made.data[i]);
      EXPECT_EQ(static_cast<std::size_t>(made.image.planes[i].stride), plane_row_bytes(format, static_cast<int>(i), 6));
      EXPECT_EQ(made.data[i] != nullptr, plane_rows(format, static_cast<int>(i), 4) > 0);
      EXPECT_TRUE(!made.data[i] || made.data[i][0] == 0);
    }
  }
}

TEST(PixelFormat, OddSizesAreRefusedWhereChromaIsShared) {
  for (const PixelFormat format : all_formats) {
    const auto refuses = [&](int width, int height) {
      try {
        make_image(format, ColorRange::full, width, height);
      } catch (const std::invalid_argument&) {
        return true;
      }
      return false;
    };
    EXPECT_EQ(refuses(5, 4), needs_even_width(format)) << name(format);
    EXPECT_EQ(refuses(4, 5), needs_even_height(format)) << name(format);
    EXPECT_TRUE(refuses(0, 4));
  }
  EXPECT_TRUE(needs_even_width(PixelFormat::yuyv) && !needs_even_height(PixelFormat::yuyv));
}

}  // namespace
}  // namespace huetrack::capture
