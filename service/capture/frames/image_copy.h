// A picture's bytes in memory of their own, where they hold nobody up: a driver's own buffer must go back to it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

// Rows back to back, plane after plane: how many bytes that takes, and into memory that has room for them.
std::size_t packed_bytes(const Image& image);
void pack(const Image& image, std::uint8_t* to);

// The same pixels, packed.
Image copy_of(const Image& image);

}  // namespace huetrack::capture
