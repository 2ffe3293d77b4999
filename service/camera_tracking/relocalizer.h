// Where a camera may be that has lost its way: corners of the image matched with the looks of the map's points.
#pragma once

#include <optional>

#include "calib/model/camera_rig.h"
#include "camera_tracking/pose_solver.h"
#include "camera_tracking/scene_map.h"

namespace huetrack::camera_tracking {

// A proposal, to be proven by whoever asks: descriptors, then P3P in a random sample consensus. nullopt: too few agree.
// Cost: corners x looks comparisons of 256 bits. seed: same seed, same answer.
std::optional<PoseFit> relocalize(const calib::Camera& camera, const Pyramid& pyramid, const SceneMap& map,
                                  std::uint64_t seed, double max_error_px = 3, int min_inliers = 10);

}  // namespace huetrack::camera_tracking
