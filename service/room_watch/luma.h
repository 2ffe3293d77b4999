// The brightness of an image in the camera's own pixel format, read where it lies; nothing is converted whole.
// Large images are read in blocks: block (i, j) of scale s covers the pixels s i .. s i + s - 1, so its centre is the
// pixel s i + (s - 1) / 2. Pure views; the image outlives them.
#pragma once

#include <cstdint>

#include "capture/frames/pixel_format.h"

namespace huetrack::room_watch {

class Luma {
 public:
  // Of bgr images it is the green channel, which is most of the brightness and has least noise.
  Luma(const capture::Image& image, int scale);

  int columns() const { return columns_; }  // whole blocks
  int rows() const { return rows_; }

  // The mean of a block, 0..255. Inside.
  float at(int column, int row) const;
  // The window of columns x rows blocks from (column, row) on, into out, row by row. False, and nothing is written,
  // where it is not wholly inside.
  bool read(int column, int row, int columns, int rows, float* out) const;

 private:
  const std::uint8_t* first_;
  std::ptrdiff_t stride_;  // bytes from one row to the next
  int step_;               // bytes from one pixel to the next
  int scale_, columns_, rows_;
};

// Blocks of about the size of a pixel of a small image: what is found in them is found to a tenth of one, and costs the
// same whatever the image's size.
int scale_for(int image_width);

}  // namespace huetrack::room_watch
