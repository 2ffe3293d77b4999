#include "calib/model/placement.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

namespace huetrack::calib {
namespace {

bool is_seen_by(const Camera& camera, const Eigen::Vector3d& place) {
  const Eigen::Vector3d p = camera.cam_from_world * place;
  const double u = camera.model.fx() * p.x() / p.z() + camera.model.cx();
  const double v = camera.model.fy() * p.y() / p.z() + camera.model.cy();
  return p.z() > 0 && u >= 0 && v >= 0 && u < camera.image_size.width && v < camera.image_size.height;
}

}  // namespace

Middle middle_of(std::span<const Camera> cameras) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  Middle middle{.is_in_all_pictures = cameras.size() > 1};
  for (const Camera& camera : cameras) {
    const Eigen::Vector3d axis = camera.cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    normal += across;
    right += across * camera.centre();
    for (const Camera& other : cameras)
      middle.widest = std::max(middle.widest, (camera.centre() - other.centre()).norm());
  }
  const Eigen::Vector3d point = normal.ldlt().solve(right);
  for (const Camera& camera : cameras) {
    middle.is_in_all_pictures = middle.is_in_all_pictures && is_seen_by(camera, point);
    middle.distance += (camera.cam_from_world * point).z() / double(cameras.size());
  }
  return middle;
}

bool see_a_place(std::span<const Camera> cameras) {
  constexpr int steps = 8;  // layout: places across the first camera's picture; distances, each twice the last
  const double widest = middle_of(cameras).widest;
  const Camera& first = cameras.front();
  const Rigid3d world_from_first = inverse(first.cam_from_world);
  for (int i = 0; i < steps * steps * steps; ++i) {
    const double u = (i % steps + 0.5) / steps * first.image_size.width;
    const double v = (i / steps % steps + 0.5) / steps * first.image_size.height;
    const double far = widest / 4 * std::exp2(i / (steps * steps));
    const Eigen::Vector3d place =
        world_from_first * Eigen::Vector3d(far * (u - first.model.cx()) / first.model.fx(),
                                           far * (v - first.model.cy()) / first.model.fy(), far);
    if (std::ranges::all_of(cameras, [&](const Camera& camera) { return is_seen_by(camera, place); })) return true;
  }
  return false;
}

void invert_poses(std::span<Camera> cameras) {
  for (Camera& camera : cameras) camera.cam_from_world = inverse(camera.cam_from_world);
}

std::optional<Middle> better_inverted(std::span<const Camera> cameras) {
  std::vector<Camera> inverted(cameras.begin(), cameras.end());
  invert_poses(inverted);
  const Middle other = middle_of(inverted);
  if (!other.is_in_all_pictures || other.widest <= middle_of(cameras).widest) return std::nullopt;
  return other;
}

bool are_probably_inverted(std::span<const Camera> cameras, const Middle& inverted) {
  const Middle as_it_is = middle_of(cameras);
  return !as_it_is.is_in_all_pictures || inverted.widest > 2 * as_it_is.widest;
}

}  // namespace huetrack::calib
