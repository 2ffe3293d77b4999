// The decision whether a frame's matches prove a pose: evidence in, verdict out. Pure.
#pragma once

#include <cstdint>

namespace huetrack::keyframes {

struct PoseEvidence {
  int sought = 0;   // map points that should be visible
  int found = 0;    // of those, matched and inliers of the fit
  int corners = 0;  // inliers among the corners of the start rectangle
  int image_width_px = 320;
  double spread_px = 0;  // smaller standard deviation over the image of the inliers, corners included
  double scale = 1;      // PoseFit::scale
  // Standard deviations of the fit, all axes together, and the median distance of the inliers.
  double position_sigma_m = 0, rotation_sigma_rad = 0, depth_m = 0;
  int map_points = 0, keyframes = 0;  // of the map
  bool is_guess = false;              // the pose does not continue the frame before: relocalised or proposed
};

enum class Proof : std::uint8_t {
  none,
  by_points,     // many points, spread over the image
  by_few,        // young map: few points, nearly all found
  by_all_given,  // started from known points, and all of them are found
  by_rectangle,  // all four corners of the start rectangle
};
Proof proof_of(const PoseEvidence& evidence);

}  // namespace huetrack::keyframes
