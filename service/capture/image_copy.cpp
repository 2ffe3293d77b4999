#include "capture/image_copy.h"

#include <cstring>
#include <utility>

namespace huetrack::capture {

Image copy_of(const Image& image) {
  WritableImage copy = make_image(image.format, image.range, image.width, image.height);
  for (std::size_t i = 0; i < image.planes.size(); ++i) {
    const auto plane = static_cast<int>(i);
    const std::size_t bytes = plane_row_bytes(image.format, plane, image.width);
    for (int row = 0; bytes > 0 && row < plane_rows(image.format, plane, image.height); ++row)
      std::memcpy(copy.data[i] + row * copy.image.planes[i].stride, image.planes[i].data + row * image.planes[i].stride,
                  bytes);
  }
  return std::move(copy.image);
}

std::size_t copied_bytes(const Image& image) {
  std::size_t bytes = 0;
  for (int plane = 0; plane < 3; ++plane)
    bytes += plane_row_bytes(image.format, plane, image.width) *
             static_cast<std::size_t>(plane_rows(image.format, plane, image.height));
  return bytes;
}

}  // namespace huetrack::capture
