// The inner loops of MatchBits: portable, for AVX2, and for AVX-512. All give the same bits as the plain reference,
// which tests/color/color_window_test verifies.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "capture/frames/pixel_format.h"
#include "color/color_model.h"

namespace huetrack::color {

struct PixelAt {
  int u, v;
};

// A tile of 8x8 pixels, counted in tiles from the top left one of the margin, which is one tile wide.
struct TileAt {
  std::uint16_t u, v;
  static constexpr int size = 8;
  int pixel_u() const { return size * (u - 1); }  // of its top left pixel
  int pixel_v() const { return size * (v - 1); }
};

inline bool has_color(const capture::Image& image, const ColorTable& table, int u, int v) {
  return image.format == capture::PixelFormat::bgr ? table.contains(capture::bgr_at(image, u, v))
                                                   : table.contains(capture::yuv_at(image, u, v));
}

// Eight bytes, the first the lowest, on any machine.
inline std::uint64_t load_word(const std::uint8_t* p) {
  std::uint64_t word;
  std::memcpy(&word, p, 8);
  return std::endian::native == std::endian::little ? word : __builtin_bswap64(word);
}

// Calls pairs.operator()<format>() where two neighbours share their chroma, and alone() where each pixel has its own.
template <typename Pairs, typename Alone>
void for_chroma_of(capture::PixelFormat format, const Pairs& pairs, const Alone& alone) {
  switch (format) {
    case capture::PixelFormat::yuyv:
      return pairs.template operator()<capture::PixelFormat::yuyv>();
    case capture::PixelFormat::nv12:
      return pairs.template operator()<capture::PixelFormat::nv12>();
    case capture::PixelFormat::i420:
      return pairs.template operator()<capture::PixelFormat::i420>();
    case capture::PixelFormat::i422:
      return pairs.template operator()<capture::PixelFormat::i422>();
    case capture::PixelFormat::i444:
    case capture::PixelFormat::bgr:
    case capture::PixelFormat::grey:
      return alone();
  }
}

struct WindowKernels {
  // Of the tiles first .. first + count - 1 of row tile_v: appends to `tiles` those that a marked window touches and
  // that are unknown in this frame, makes them known, and returns their number. A window is marked in the cell of 4x4
  // pixels in which it begins; it touches a tile if that is one of the tile's four cells, or left of or above them.
  //   marked  the tile's upper row of cells, the others cell_stride bytes away; readable from one byte before the first
  //           tile's cells to 32 bytes after the last one's
  //   known   per tile of the row, the frame that it is known for; readable and writable 64 bytes on, which stay
  //   unchanged tiles   room for count + 16
  std::size_t (*touched)(const std::uint8_t* marked, std::ptrdiff_t cell_stride, std::uint32_t* known,
                         std::uint32_t frame, int first, int count, int tile_v, TileAt* tiles);
  // Of each tile, which must lie wholly inside the image: bit 8 r + c says whether the pixel in row r and column c has
  // the target's colour.
  void (*classify)(const capture::Image& image, const ColorTable& table, const TileAt* tiles, std::size_t n,
                   std::uint64_t* bits);
  // k[i]: the matching pixels of a window whose five rows are the low five bits of bands[byte[i]] .. bands[byte[i] +
  // 4], after a shift to the right by the low two bits of shift[i]; or-ed with the second byte of shift[i].
  void (*count)(const std::uint8_t* bands, const std::int32_t* byte, const std::int32_t* shift, std::size_t n,
                std::uint8_t* k);
};

const WindowKernels& portable_window_kernels();
const WindowKernels* avx2_window_kernels();    // nullptr: this machine has none
const WindowKernels* avx512_window_kernels();  // likewise
const WindowKernels& best_window_kernels();

}  // namespace huetrack::color
