// Copies of images, so that a driver's buffer can be returned to it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

// Packed: rows back to back, plane after plane. pack() needs packed_bytes() at `to`.
std::size_t packed_bytes(const Image& image);
void pack(const Image& image, std::uint8_t* to);

Image copy_of(const Image& image);

}  // namespace huetrack::capture
