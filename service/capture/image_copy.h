// A copy of a picture that holds nobody up: a driver's own buffer must go back to it.
#pragma once

#include <cstddef>

#include "capture/pixel_format.h"

namespace huetrack::capture {

// The same pixels in memory of their own, with tight rows.
Image copy_of(const Image& image);
std::size_t copied_bytes(const Image& image);  // that its copy has

}  // namespace huetrack::capture
