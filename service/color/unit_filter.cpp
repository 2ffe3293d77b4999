#include "color/unit_filter.h"

namespace huetrack::color {

void UnitFilter::look_at(const capture::PixelsOnDemand* pixels, const ColorTable& table) {
  pixels_ = pixels;
  may_.clear();
  if (pixels == nullptr) return;
  column_shift_ = pixels->column_shift(), row_shift_ = pixels->row_shift(), columns_ = pixels->columns();
  const auto bounds = pixels->chroma_bounds();
  may_.reserve(bounds.size());
  for (const capture::ChromaBounds& unit : bounds) may_.push_back(table.may_contain(unit) ? 1 : 0);
}

void UnitFilter::require_grid(int step) const {
  if (pixels_ == nullptr) return;
  const auto has_point = [step](int unit, int shift) {
    const int first = unit << shift, last = first + (1 << shift) - 1;
    const int point = first <= step / 2 ? step / 2 : first + (step - (first - step / 2) % step) % step;
    return point <= last;
  };
  for (int row = 0; row < pixels_->rows(); ++row) {
    if (!has_point(row, row_shift_)) continue;
    const int v = row << row_shift_;
    for (int first = 0, end = 0; first < columns_; first = end + 1) {  // runs of wanted units
      for (end = first; end < columns_ && has_point(end, column_shift_) && may_match(end << column_shift_, v);) ++end;
      if (end > first) pixels_->require(first << column_shift_, v, end << column_shift_, v + (1 << row_shift_));
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
