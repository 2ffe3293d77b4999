// What an encoded picture (JPEG, PNG, WebP, TIFF) says of itself beside its pixels. One list for recordings, bags and
// calibrations, whichever library decodes. Pure functions; thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "capture/frames/picture_layout.h"

namespace huetrack::capture {

struct PictureTags {
  std::optional<Orientation> orientation = {};  // how viewers turn it (EXIF, TIFF); nullopt: not said
  std::size_t orientation_at = 0;               // of the byte that says it; 0: none does
  int significant_bits = 0;                     // the camera's bits a sample (sBIT of a PNG); 0: not said
};
PictureTags tags_of(std::span<const std::uint8_t> encoded);

}  // namespace huetrack::capture
