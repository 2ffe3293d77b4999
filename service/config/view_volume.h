// The volume that one camera sees.
#pragma once

#include <Eigen/Core>

#include "calib/model/camera_rig.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::config {

// Encloses what the camera sees, from near by to where the picture of a ball is too small for its distance. World
// frame, metres, whole centimetres. radius_m: of the largest ball, > 0.
object_tracking::Volume seen_volume(const calib::Camera& camera, double radius_m);

// Whether the ray through this pixel passes through the volume, not just close to the camera. False also for a pixel
// without a ray.
bool meets_volume(const calib::Camera& camera, const Eigen::Vector2d& px, const object_tracking::Volume& volume);

}  // namespace huetrack::config
