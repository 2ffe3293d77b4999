// Packed images: rows back to back, plane after plane. Copies, so that a driver's buffer can be returned to it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

std::size_t packed_bytes(const Image& image);
// Copies packed_bytes() to `to`.
void pack(const Image& image, std::uint8_t* to);
// Sets planes and owner to packed_bytes() at `bytes`, by the image's format and size.
void set_packed(Image& image, const std::uint8_t* bytes, std::shared_ptr<const void> owner);

Image copy_of(const Image& image);

}  // namespace huetrack::capture
