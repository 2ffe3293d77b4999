// An image in which exactly the chosen pixels match, and the table that says so: for tests of what stands on the match
// bits.
#pragma once

#include "capture/frames/pixel_format.h"
#include "color/color_model.h"

namespace huetrack::color {

template <typename Chosen>
capture::Image mask_image(int width, int height, Chosen chosen) {
  capture::WritableImage out =
      capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, width, height);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) out.data[0][v * out.image.planes[0].stride + u] = chosen(u, v) ? 200 : 50;
  }
  return out.image;
}

inline const ColorTable& mask_table() {
  static const ColorTable table({0, 360, 0, 1, 0.5, 1}, capture::PixelFormat::grey, capture::ColorRange::full);
  return table;
}

}  // namespace huetrack::color
