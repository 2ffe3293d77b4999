// A part of an image as an image of its own, for cameras that share one picture: side-by-side stereo webcams. Pure
// functions.
#pragma once

#include <string>

#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

struct Crop {
  int u = 0, v = 0;  // of its first pixel, >= 0
  int width = 0, height = 0;
  bool operator==(const Crop&) const = default;
};

std::string text_of(const Crop& crop);  // "[640, 0, 640, 480]", as in files

// Why it is no part of an image of this format and size; empty: it is one. Formats whose neighbouring pixels share
// chroma need even columns, those whose rows do (4:2:0) even rows.
std::string problem_of(const Crop& crop, PixelFormat format, int width, int height);

// That part, without a copy; of a compressed image it is decoded on demand, too, and its eighth() has the blocks that
// lie wholly in it. throws std::invalid_argument: problem_of()
Image cropped(const Image& image, const Crop& crop);

}  // namespace huetrack::capture
