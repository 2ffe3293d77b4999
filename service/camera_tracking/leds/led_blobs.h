// Lit LEDs in the raw image: bright dots, their centres to a fraction of a pixel. Herranz et al., section II.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "capture/frames/pixel_format.h"

namespace huetrack::leds {

struct LedBlob {
  Eigen::Vector2d px;  // centre, raw pixels: the distorted image, as the paper has it
  int peak = 0;        // brightness of its brightest pixel, 1..255
  int area_px = 0;     // pixels above the threshold
};

// The brightest pixel first; then the average of the connected pixels around it, weighted with their brightness above
// the threshold. Reads Y of the YUV family and of grey images, and the mean of B, G, R of bgr ones; converts nothing.
// Brightest (peak times area) first. Pure; safe from any thread.
std::vector<LedBlob> find_led_blobs(const capture::Image& image);

}  // namespace huetrack::leds
