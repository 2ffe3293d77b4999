// The two inner loops of MatchBits, once for every machine and once for those with AVX-512: the same bits from both, which
// tests/object_tracking/color_window_test holds to the plain reference.
#pragma once

#include <cstddef>
#include <cstdint>

#include "capture/pixel_format.h"
#include "object_tracking/color_model.h"

namespace huetrack {

struct PixelAt { int u, v; };

struct WindowKernels {
  // Of each tile of 8x8 pixels, given by its top left pixel and wholly inside the image: bit 8 r + c says whether the pixel in
  // row r and column c has the target's colour.
  void (*classify)(const Image& image, const ColorTable& table, const PixelAt* tiles, std::size_t n, std::uint64_t* bits);
  // k[i]: the matching pixels of a window whose five rows are the low five bits of bands[byte[i]] .. bands[byte[i] + 4], after
  // a shift to the right by the low two bits of shift[i]; or-ed with the second byte of shift[i].
  void (*count)(const std::uint8_t* bands, const std::int32_t* byte, const std::int32_t* shift, std::size_t n, std::uint8_t* k);
};

const WindowKernels& portable_window_kernels();
const WindowKernels* avx512_window_kernels();      // nullptr: this machine has none
const WindowKernels& best_window_kernels();

}  // namespace huetrack
