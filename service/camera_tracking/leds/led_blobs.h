// Detects lit LEDs as bright dots, with sub-pixel centres. Herranz et al., section II.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "capture/frames/pixel_format.h"

namespace huetrack::leds {

struct LedBlob {
  Eigen::Vector2d px;  // centre, raw pixels
  int peak = 0;        // brightness of its brightest pixel, 1..255
  int area_px = 0;     // pixels above the threshold
};

// Centroids of the connected pixels around local maxima, weighted by their brightness above the threshold; the
// brightest (peak times area) first. Reads Y, grey, or the mean of B, G, R without a conversion. Pure; safe from any
// thread.
std::vector<LedBlob> find_led_blobs(const capture::Image& image);

}  // namespace huetrack::leds
