#include "capture/frames/jpeg_encoder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "capture/frames/jpeg_decoder.h"

namespace huetrack::capture {
namespace {

// The left half dark, the right half of the given colour.
WritableImage two_halves(PixelFormat format, ColorRange range, Yuv color) {
  WritableImage w = make_image(format, range, 64, 32);
  const bool full = range == ColorRange::full;
  for (int v = 0; v < 32; ++v) {
    for (int u = 0; u < 64; ++u) {
      const Yuv p = u < 32 ? Yuv{std::uint8_t(full ? 0 : 16), 128, 128} : color;
      const auto at = [&](int plane, int column, int row) -> std::uint8_t& {
        return w.data[std::size_t(plane)][row * w.image.planes[std::size_t(plane)].stride + column];
      };
      switch (format) {
        case PixelFormat::yuyv:
          at(0, 2 * u, v) = p.y, at(0, 2 * u + 1, v) = u % 2 == 0 ? p.u : p.v;
          break;
        case PixelFormat::nv12:
          at(0, u, v) = p.y, at(1, u & ~1, v / 2) = p.u, at(1, u | 1, v / 2) = p.v;
          break;
        case PixelFormat::i420:
          at(0, u, v) = p.y, at(1, u / 2, v / 2) = p.u, at(2, u / 2, v / 2) = p.v;
          break;
        case PixelFormat::i422:
          at(0, u, v) = p.y, at(1, u / 2, v) = p.u, at(2, u / 2, v) = p.v;
          break;
        case PixelFormat::i444:
          at(0, u, v) = p.y, at(1, u, v) = p.u, at(2, u, v) = p.v;
          break;
        case PixelFormat::grey:
          at(0, u, v) = p.y;
          break;
        case PixelFormat::bgr:
          at(0, 3 * u, v) = u < 32 ? 0 : 30, at(0, 3 * u + 1, v) = u < 32 ? 0 : 60,
                       at(0, 3 * u + 2, v) = u < 32 ? 0 : 200;
          break;
      }
    }
  }
  return w;
}

Yuv decoded(const std::vector<std::uint8_t>& jpeg, int u, int v, int width) {
  const JpegResult result = JpegDecoder().decode(jpeg);
  EXPECT_TRUE(result.image) << result.problem;
  if (!result.image) return {};
  EXPECT_EQ(result.image->width, width);
  return yuv_at(*result.image, u, v);
}

TEST(JpegEncoder, EncodesEveryFormatInItsColours) {
  for (const auto format :
       {PixelFormat::yuyv, PixelFormat::nv12, PixelFormat::i420, PixelFormat::i422, PixelFormat::i444}) {
    SCOPED_TRACE(name(format));
    const auto image = two_halves(format, ColorRange::full, {120, 90, 180}).image;
    const auto jpeg = encode_picture(image, picture_size(image, 32), 95);
    const Yuv p = decoded(jpeg, 24, 8, 32);
    EXPECT_NEAR(p.y, 120, 3);
    EXPECT_NEAR(p.u, 90, 3);
    EXPECT_NEAR(p.v, 180, 3);
    EXPECT_NEAR(decoded(jpeg, 6, 8, 32).y, 0, 4);
  }
  const auto limited = two_halves(PixelFormat::yuyv, ColorRange::limited, {235, 128, 128}).image;
  EXPECT_NEAR(decoded(encode_picture(limited, picture_size(limited, 64), 95), 50, 8, 64).y, 255, 2);  // white is white
  const auto grey = two_halves(PixelFormat::grey, ColorRange::full, {77, 0, 0}).image;
  EXPECT_NEAR(decoded(encode_picture(grey, picture_size(grey, 64), 95), 50, 8, 64).y, 77, 2);
  const auto bgr = two_halves(PixelFormat::bgr, ColorRange::full, {}).image;
  const Yuv red = decoded(encode_picture(bgr, picture_size(bgr, 32), 95), 24, 8, 32);
  EXPECT_NEAR(red.y, 0.299 * 200 + 0.587 * 60 + 0.114 * 30, 3);
  EXPECT_GT(red.v, 180);
}

TEST(JpegEncoder, NeverScalesUpAndStaysEven) {
  const auto image = make_image(PixelFormat::bgr, ColorRange::full, 641, 479).image;
  EXPECT_EQ(picture_size(image, 2000).width, 640);
  const PictureSize size = picture_size(image, 333);
  EXPECT_EQ(size.width, 332);
  EXPECT_EQ(size.height, 248);
  EXPECT_LE(decoded(encode_picture(image, size, 70), 331, 247, 332).y, 2);
  const auto tiny = make_image(PixelFormat::grey, ColorRange::full, 1, 1).image;
  EXPECT_FALSE(encode_picture(tiny, picture_size(tiny, 16), 50).empty());
}

}  // namespace
}  // namespace huetrack::capture
