// The inverse DCT of JPEG, bit for bit as libjpeg-turbo's accurate integer transform (JDCT_ISLOW) on x86-64. Its 16-bit
// sums wrap and its 16-bit results saturate, which matters for damaged coefficients only.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace huetrack::capture {

// Dequantised coefficients, modulo 2^16; row by row, the DC coefficient first.
struct alignas(32) JpegBlock {
  std::array<std::int16_t, 64> coefficients{};
};

// is_first_row_only: all quantised coefficients outside the first row are 0; libjpeg-turbo has a short cut for them.
// pixels: eight rows of eight.
void inverse_transform(const JpegBlock& block, bool is_first_row_only, std::uint8_t* pixels, std::ptrdiff_t stride);
// The same without vector instructions: for other machines, and as the reference.
void plain_inverse_transform(const JpegBlock& block, bool is_first_row_only, std::uint8_t* pixels,
                             std::ptrdiff_t stride);

// Memory of a block's pixels: eight rows of eight.
struct BlockPixels {
  std::uint8_t* pixels = nullptr;
  std::ptrdiff_t stride = 0;
};
// Two blocks at once, neither of them with its first row only. The second function needs AVX2; false: not available.
void inverse_transform_two(const std::array<JpegBlock, 2>& blocks, const std::array<BlockPixels, 2>& to);
bool avx2_inverse_transform_two(const std::array<JpegBlock, 2>& blocks, const std::array<BlockPixels, 2>& to);

// The value of all pixels of a block with only a DC coefficient; dc: dequantised, modulo 2^16.
inline std::uint8_t jpeg_mean(std::int16_t dc) {
  const int mean = (static_cast<std::int16_t>(dc * 4) + 16) >> 5;
  return static_cast<std::uint8_t>((mean < -128 ? -128 : mean > 127 ? 127 : mean) + 128);
}

}  // namespace huetrack::capture
