// The target's colour in HSI, as in the paper (section 2.2): a range of hue and of saturation; pixels that are very dark
// or very bright match nothing.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "capture/pixel_format.h"

namespace huetrack {

// Degrees and shares, inclusive on both ends.
struct HsiRange {
  double hue_min_deg = 0, hue_max_deg = 360;           // [0, 360]; min > max: through 0, as in 340..20 for red
  double saturation_min = 0.3, saturation_max = 1;     // [0, 1]
  double intensity_min = 0.1, intensity_max = 0.95;    // [0, 1]
  std::vector<std::string> problems() const;
};

}  // namespace huetrack
