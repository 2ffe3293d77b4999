#include "color/unit_filter.h"

#include <algorithm>

namespace huetrack::color {

namespace {

// Whether one of `step/2 + i step` lies in a unit of 2^shift pixels.
bool has_point(int unit, int shift, int step) {
  const int first = unit << shift, last = first + (1 << shift) - 1;
  const int point = first <= step / 2 ? step / 2 : first + (step - (first - step / 2) % step) % step;
  return point <= last;
}

}  // namespace

UnitFilter::UnitFilter(const capture::PixelsOnDemand* pixels, const ColorTable* table, int step, const PixelBox& box)
    : pixels_(pixels) {
  if (pixels == nullptr) return;
  column_shift_ = pixels->column_shift(), row_shift_ = pixels->row_shift(), columns_ = pixels->columns();
  const auto bounds = pixels->bounds();
  const auto may_contain = [&](std::size_t unit) {
    if (bounds.empty()) return true;
    capture::PixelBounds narrowed = bounds[unit];
    if (!table->may_contain(narrowed)) return false;
    pixels->narrow_chroma(unit, narrowed);
    return table->may_contain(narrowed);
  };
  may_.resize(pixels->units());
  const int last_row = std::min(box.v_max >> row_shift_, pixels->rows() - 1);
  const int last_column = std::min(box.u_max >> column_shift_, columns_ - 1);
  for (int row = std::max(box.v_min, 0) >> row_shift_; row <= last_row; ++row) {
    if (!has_point(row, row_shift_, step)) continue;
    for (int column = std::max(box.u_min, 0) >> column_shift_; column <= last_column; ++column) {
      const auto unit = static_cast<std::size_t>(row * columns_ + column);
      may_[unit] = has_point(column, column_shift_, step) && may_contain(unit) ? 1 : 0;
    }
  }
}

void UnitFilter::require() const {
  if (pixels_ == nullptr) return;
  for (int row = 0; row < pixels_->rows(); ++row) {
    const std::uint8_t* const may = &may_[static_cast<std::size_t>(row * columns_)];
    for (int first = 0, end = 0; first < columns_; first = end + 1) {  // runs of wanted units
      for (end = first; end < columns_ && may[end] != 0;) ++end;
      if (end > first)
        pixels_->require(first << column_shift_, row << row_shift_, end << column_shift_, (row + 1) << row_shift_);
    }
  }
}

void require_tiles(const capture::PixelsOnDemand* pixels, std::span<const TileAt> tiles) {
  if (pixels == nullptr) return;
  for (std::size_t i = 0, end = 0; i < tiles.size(); i = end) {
    for (end = i + 1; end < tiles.size() && tiles[end].v == tiles[i].v && tiles[end].u == tiles[end - 1].u + 1;) ++end;
    pixels->require(tiles[i].pixel_u(), tiles[i].pixel_v(), tiles[end - 1].pixel_u() + TileAt::size,
                    tiles[i].pixel_v() + TileAt::size);
  }
}

}  // namespace huetrack::color
