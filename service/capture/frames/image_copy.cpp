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
  require_all(image);
  for (int i = 0; i < 3; ++i) {
    const auto& plane = image.planes[static_cast<std::size_t>(i)];
    const std::size_t bytes = plane_row_bytes(image.format, i, image.width);
    for (int y = 0; bytes > 0 && y < plane_rows(image.format, i, image.height); ++y, to += bytes)
      std::memcpy(to, plane.data + y * plane.stride, bytes);
  }
}

void set_packed(Image& image, const std::uint8_t* bytes, std::shared_ptr<const void> owner) {
  image.planes = {};
  for (int i = 0; i < 3 && plane_rows(image.format, i, image.height) > 0; ++i) {
    const auto stride = static_cast<std::ptrdiff_t>(plane_row_bytes(image.format, i, image.width));
    image.planes[static_cast<std::size_t>(i)] = {bytes, stride};
    bytes += stride * plane_rows(image.format, i, image.height);
  }
  image.owner = std::move(owner);
  image.on_demand = nullptr;
}

Image copy_of(const Image& image) {
  auto memory = std::make_shared_for_overwrite<std::uint8_t[]>(packed_bytes(image));
  pack(image, memory.get());
  Image copy = image;
  set_packed(copy, memory.get(), memory);
  return copy;
}

}  // namespace huetrack::capture
