// Whether what a frame shows proves a pose. Facts in, verdict out: no image, no state.
#pragma once

#include <cstdint>

namespace huetrack::keyframes {

// What was measured of a pose.
struct PoseEvidence {
  int sought = 0;   // map points that should be seen
  int found = 0;    // those of them that are where the pose has them
  int corners = 0;  // of the start rectangle, measured and agreeing
  int image_width_px = 320;
  double spread_px = 0;  // of what was found, corners included, over the image: the smaller standard deviation
  double scale = 1;      // the residuals over what they should be
  // What the fit leaves open, all axes together, and the median distance of what was found.
  double position_sigma_m = 0, rotation_sigma_rad = 0, depth_m = 0;
  int map_points = 0, keyframes = 0;  // that the map has
  // The pose is not one that goes on from the frame before: the key frames or the start proposed it.
  bool is_guess = false;
};

// By what a pose is proven.
enum class Proof : std::uint8_t {
  none,
  by_points,     // many, all over the image
  by_few,        // young map: there are not many yet
  by_all_given,  // started from some known points, and all of them are found
  by_rectangle,  // all four corners of the start's rectangle
};
Proof proof_of(const PoseEvidence& evidence);

}  // namespace huetrack::keyframes
