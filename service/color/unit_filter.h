// Which parts of a compressed image may have a colour, by bounds of their samples: the others need not be decoded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "capture/frames/pixel_format.h"
#include "color/color_model.h"
#include "color/color_window.h"
#include "color/window_kernels.h"

namespace huetrack::color {

// thread-compatible.
class UnitFilter {
 public:
  // Of the pixels (step/2 + i step, step/2 + j step) of this box; a step of 1 or 2 is all of them. pixels: of an image
  // that `table` is for; nullptr: all pixels are there, and table may be nullptr.
  UnitFilter(const capture::PixelsOnDemand* pixels, const ColorTable* table, int step,
             const PixelBox& box = whole_image);

  // Of a pixel of the grid in the box, inside the image. False: it does not match, and may not be decoded. True: it may
  // match.
  bool may_match(int u, int v) const {
    return may_.empty() || may_[static_cast<std::size_t>((v >> row_shift_) * columns_ + (u >> column_shift_))] != 0;
  }
  // Decodes the units that may match.
  void require() const;

 private:
  static constexpr PixelBox whole_image{0, 0, 1 << 30, 1 << 30};

  const capture::PixelsOnDemand* const pixels_;
  int column_shift_ = 0, row_shift_ = 0, columns_ = 0;
  std::vector<std::uint8_t> may_;  // per unit; empty: everywhere
};

// Decodes these tiles, which begin inside the image. pixels: nullptr: all pixels are there.
void require_tiles(const capture::PixelsOnDemand* pixels, std::span<const TileAt> tiles);

}  // namespace huetrack::color
