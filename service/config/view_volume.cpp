#include "config/view_volume.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace huetrack::config {
namespace {

struct SeenVolumeTuning {
  double nearest_m = 0.2;  // a ball that is nearer is out of focus, or fills the picture
  // A coloured region's radius is wrong by half a pixel: a quarter of the distance, the most that `tracking` allows
  // (ObjectTrackerOptions::max_tracking_share_along).
  double least_radius_px = 2;
  double furthest_m = 10;  // a large room
};
constexpr SeenVolumeTuning seen_volume_tuning{};

// From the camera's centre, world frame.
std::optional<Eigen::Vector3d> direction_of(const calib::Camera& camera, const Eigen::Vector2d& px) {
  const auto ray = camera.model.ray({px});
  if (!ray) return std::nullopt;
  return camera.cam_from_world.rotation.conjugate() * ray->normalized();
}

}  // namespace

object_tracking::Volume seen_volume(const calib::Camera& camera, double radius_m) {
  const SeenVolumeTuning& t = seen_volume_tuning;
  const double far_m = std::clamp(radius_m * camera.model.fx() / t.least_radius_px, 2 * t.nearest_m, t.furthest_m);
  constexpr int steps =
      12;  // layout: of the grid over the picture; a wide lens sees furthest aside between its corners
  constexpr double none = std::numeric_limits<double>::infinity();
  object_tracking::Volume box{Eigen::Vector3d::Constant(none), Eigen::Vector3d::Constant(-none)};
  for (int i = 0; i <= steps; ++i) {
    for (int j = 0; j <= steps; ++j) {
      const auto direction = direction_of(
          camera, {(camera.image_size.width - 1.0) * i / steps, (camera.image_size.height - 1.0) * j / steps});
      if (!direction) continue;
      for (const double depth_m : {t.nearest_m, far_m}) {
        const Eigen::Vector3d p = camera.centre() + depth_m * *direction;
        box.min = box.min.cwiseMin(p);
        box.max = box.max.cwiseMax(p);
      }
    }
  }
  constexpr double per_m = 100;  // centimetres
  box.min = (box.min.array() * per_m).floor() / per_m;
  box.max = (box.max.array() * per_m).ceil() / per_m;
  return box;
}

bool meets_volume(const calib::Camera& camera, const Eigen::Vector2d& px, const object_tracking::Volume& volume) {
  const auto direction = direction_of(camera, px);
  if (!direction) return false;
  const Eigen::Vector3d from = camera.centre();
  double enters = seen_volume_tuning.nearest_m, leaves = std::numeric_limits<double>::infinity();
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double speed = (*direction)[axis];
    if (speed == 0) {
      if (from[axis] < volume.min[axis] || from[axis] > volume.max[axis]) return false;
      continue;
    }
    const double a = (volume.min[axis] - from[axis]) / speed, b = (volume.max[axis] - from[axis]) / speed;
    enters = std::max(enters, std::min(a, b));
    leaves = std::min(leaves, std::max(a, b));
  }
  return enters <= leaves;
}

}  // namespace huetrack::config
