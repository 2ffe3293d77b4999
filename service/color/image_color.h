// The colour of one pixel of an image in any format. For a few pixels; the tracking pipeline uses color_window.h.
#pragma once

#include "capture/frames/frame.h"
#include "color/color_model.h"

namespace huetrack::color {

// u, v: inside the image.
inline Rgb rgb_at(const capture::Image& image, int u, int v) {
  return image.format == capture::PixelFormat::bgr ? rgb_of(capture::bgr_at(image, u, v))
                                                   : rgb_of(capture::yuv_at(image, u, v), image.range);
}

}  // namespace huetrack::color
