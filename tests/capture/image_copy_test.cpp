#include "capture/frames/image_copy.h"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace huetrack::capture {
namespace {

// As drivers give them: rows that are longer than what is in them, planes that begin where they like.
TEST(ImageCopy, CopiesPixelsNotTheBuffer) {
  for (const PixelFormat format : {PixelFormat::yuyv, PixelFormat::nv12, PixelFormat::i420, PixelFormat::i422,
                                   PixelFormat::i444, PixelFormat::bgr, PixelFormat::grey}) {
    SCOPED_TRACE(name(format));
    constexpr int width = 6, height = 4, stride = 32;
    std::array<std::vector<std::uint8_t>, 3> bytes;
    const auto owner = std::make_shared<int>(0);
    Image image{
        .format = format, .range = ColorRange::full, .width = width, .height = height, .planes = {}, .owner = owner};
    for (std::size_t i = 0; i < 3; ++i) {
      if (plane_row_bytes(format, int(i), width) == 0) continue;
      for (int b = 0; b < stride * height; ++b) bytes[i].push_back(std::uint8_t(b * 5 + int(i) * 70 + 1));
      image.planes[i] = {bytes[i].data(), stride};
    }
    const auto shown = bytes;
    const Image copy = copy_of(image);
    for (auto& plane : bytes) plane.assign(plane.size(), 0);  // the driver has it back
    EXPECT_EQ(owner.use_count(), 2);                          // here and in the image, not in the copy
    EXPECT_EQ(copy.format, format);
    EXPECT_EQ(copy.range, ColorRange::full);
    ASSERT_EQ(copy.width, width);
    ASSERT_EQ(copy.height, height);
    std::size_t copied = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto row_bytes = std::ptrdiff_t(plane_row_bytes(format, int(i), width));
      EXPECT_EQ(copy.planes[i].data == nullptr, row_bytes == 0);
      for (int row = 0; row < plane_rows(format, int(i), height); ++row)
        for (std::ptrdiff_t b = 0; b < row_bytes; ++b)
          EXPECT_EQ(copy.planes[i].data[row * copy.planes[i].stride + b], shown[i][std::size_t(row * stride + b)])
              << "plane " << i << ", row " << row << ", byte " << b;
      copied += std::size_t(row_bytes * plane_rows(format, int(i), height));
    }
    EXPECT_EQ(packed_bytes(image), copied);
  }
}

}  // namespace
}  // namespace huetrack::capture
