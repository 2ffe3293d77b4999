// Relocalisation of a lost camera: matches corners of the image with the descriptors of the map's points.
#pragma once

#include <optional>

#include "calib/model/camera_rig.h"
#include "camera_tracking/pose_solver.h"
#include "camera_tracking/scene_map.h"

namespace huetrack::camera_tracking {

// Descriptor matches, then solve_pose_ransac(). The caller has to verify the pose. nullopt: fewer than 10 inliers.
// Cost: corners x views comparisons of 256 bits. Deterministic for a seed.
std::optional<PoseFit> relocalize(const calib::Camera& camera, const Pyramid& pyramid, const SceneMap& map,
                                  std::uint64_t seed, double max_error_px = 3);

}  // namespace huetrack::camera_tracking
