#include "capture/frames/crop.h"

#include <stdexcept>

namespace huetrack::capture {

std::string text_of(const Crop& crop) {
  return "[" + std::to_string(crop.u) + ", " + std::to_string(crop.v) + ", " + std::to_string(crop.width) + ", " +
         std::to_string(crop.height) + "]";
}

std::string problem_of(const Crop& crop, PixelFormat format, int width, int height) {
  if (crop.u < 0 || crop.v < 0 || crop.width < 1 || crop.height < 1 || crop.width > width - crop.u ||
      crop.height > height - crop.v)
    return "crop " + text_of(crop) + " (u, v, width, height) is no part of the picture, which is " +
           std::to_string(width) + "x" + std::to_string(height);
  const bool needs_columns = needs_even_width(format), needs_rows = needs_even_height(format);
  if ((needs_columns && (crop.u % 2 != 0 || crop.width % 2 != 0)) ||
      (needs_rows && (crop.v % 2 != 0 || crop.height % 2 != 0)))
    return "crop " + text_of(crop) + " must have even columns" + (needs_rows ? " and rows" : "") +
           ": the pictures are " + std::string(name(format)) + ", in which neighbours share their colour";
  return {};
}

Image cropped(const Image& image, const Crop& crop) {
  if (const auto problem = problem_of(crop, image.format, image.width, image.height); !problem.empty())
    throw std::invalid_argument(problem);
  require(image, crop.u, crop.v, crop.u + crop.width, crop.v + crop.height);
  Image part = image;
  part.on_demand.reset();  // all of it is there
  part.width = crop.width;
  part.height = crop.height;
  for (int p = 0; p < static_cast<int>(part.planes.size()); ++p) {
    Plane& plane = part.planes[static_cast<std::size_t>(p)];
    if (plane.data == nullptr) continue;
    // A plane's rows and bytes before the part are those of an image of that size.
    plane.data += plane_rows(image.format, p, crop.v) * plane.stride +
                  static_cast<std::ptrdiff_t>(plane_row_bytes(image.format, p, crop.u));
  }
  return part;
}

}  // namespace huetrack::capture
