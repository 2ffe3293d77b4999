// Which parts of a compressed image may have a colour, by bounds of their chroma: the others need not be decoded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "capture/frames/pixel_format.h"
#include "color/color_model.h"
#include "color/window_kernels.h"

namespace huetrack::color {

// thread-compatible. Keeps its work space between frames.
class UnitFilter {
 public:
  // pixels: of an image that `table` is for; nullptr: all pixels are there.
  void look_at(const capture::PixelsOnDemand* pixels, const ColorTable& table);

  // False: the pixel (inside the image) does not match, and may not be decoded. True: it may match.
  bool may_match(int u, int v) const {
    return may_.empty() || may_[static_cast<std::size_t>((v >> row_shift_) * columns_ + (u >> column_shift_))] != 0;
  }
  // Decodes the units that may match and hold a pixel of the grid (step/2 + i step, step/2 + j step).
  void require_grid(int step) const;

 private:
  const capture::PixelsOnDemand* pixels_ = nullptr;
  int column_shift_ = 0, row_shift_ = 0, columns_ = 0;
  std::vector<std::uint8_t> may_;  // per unit; empty: everywhere
};

// Decodes these tiles, which begin inside the image. pixels: nullptr: all pixels are there.
void require_tiles(const capture::PixelsOnDemand* pixels, std::span<const TileAt> tiles);

}  // namespace huetrack::color
