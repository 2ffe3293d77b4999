// Brightness of an image in the camera's own pixel format, read in place. Large images are read in blocks: block (i, j)
// of scale s is the mean of the pixels s i .. s i + s - 1; its centre is the pixel s i + (s - 1) / 2. The image
// outlives the view.
#pragma once

#include <cstdint>

#include "capture/frames/pixel_format.h"

namespace huetrack::room_watch {

class Luma {
 public:
  // Of bgr images the green channel: most of the brightness, least noise.
  Luma(const capture::Image& image, int scale);

  int columns() const { return columns_; }  // whole blocks
  int rows() const { return rows_; }

  // Mean of a block inside the image, 0..255.
  float at(int column, int row) const {
    require(column, row, 1, 1);
    return mean(column, row);
  }
  // Writes the window of columns x rows blocks from (column, row) to out, row by row. False, and nothing is written,
  // where it is not wholly inside.
  bool read(int column, int row, int columns, int rows, float* out) const;

 private:
  void require(int column, int row, int columns, int rows) const {
    if (on_demand_ == nullptr) return;
    on_demand_->require(column * scale_, row * scale_, (column + columns) * scale_, (row + rows) * scale_);
  }
  float mean(int column, int row) const;

  const capture::PixelsOnDemand* on_demand_;  // nullptr: all pixels are there
  const std::uint8_t* first_;
  std::ptrdiff_t stride_;  // bytes from one row to the next
  int step_;               // bytes from one pixel to the next
  int scale_, columns_, rows_;
};

// Side of a block in pixels, so that cost and precision are the same for images of any size.
int scale_for(int image_width);

}  // namespace huetrack::room_watch
