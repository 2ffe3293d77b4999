#include "capture/frames/image_copy.h"

#include <cstring>
#include <utility>

namespace huetrack::capture {

std::size_t packed_bytes(const Image& image) {
  std::size_t bytes = 0;
  for (int i = 0; i < 3; ++i)
    bytes += plane_row_bytes(image.format, i, image.width) *
             static_cast<std::size_t>(plane_rows(image.format, i, image.height));
  return bytes;
}

void pack(const Image& image, std::uint8_t* to) {
  for (int i = 0; i < 3; ++i) {
    const auto& plane = image.planes[static_cast<std::size_t>(i)];
    const std::size_t bytes = plane_row_bytes(image.format, i, image.width);
    for (int y = 0; bytes > 0 && y < plane_rows(image.format, i, image.height); ++y, to += bytes)
      std::memcpy(to, plane.data + y * plane.stride, bytes);
  }
}

Image copy_of(const Image& image) {
  WritableImage copy = make_image(image.format, image.range, image.width, image.height);  // which is packed
  pack(image, copy.data[0]);
  return std::move(copy.image);
}

}  // namespace huetrack::capture
