#include "benchmark/rig_figures.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace huetrack::figures {
namespace {

struct Aligned {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  double rms_m = 0;
  double scale = 1;
};

// Points, projected by the true rig and triangulated with the found one; rigidly aligned.
Aligned align(const calib::CameraRig& truth, const calib::CameraRig& found,
              const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector3d> from, to;
  for (const Eigen::Vector3d& p : points) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    int views = 0;
    for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
      const auto px = truth.cameras[c].project_world(p);
      if (!px || !truth.cameras[c].contains(*px)) continue;
      const auto ray = found.cameras[c].model.ray(*px);
      if (!ray) continue;
      const calib::Rigid3d world_from_cam = calib::inverse(found.cameras[c].cam_from_world);
      const Eigen::Vector3d d = world_from_cam.rotation * *ray;
      const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - d * d.transpose();
      sum += across;
      right += across * world_from_cam.translation;
      ++views;
    }
    if (views < 2) continue;
    from.push_back(sum.inverse() * right);
    to.push_back(p);
  }
  Eigen::Matrix3Xd a(3, from.size()), b(3, to.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    a.col(static_cast<Eigen::Index>(i)) = from[i];
    b.col(static_cast<Eigen::Index>(i)) = to[i];
  }
  const Eigen::Matrix4d t = Eigen::umeyama(a, b, false);
  Aligned result{t.topLeftCorner<3, 3>(), t.topRightCorner<3, 1>()};
  result.rms_m = std::sqrt(((result.rotation * a).colwise() + result.translation - b).colwise().squaredNorm().mean());
  result.scale = 1 / std::cbrt(Eigen::umeyama(a, b, true).topLeftCorner<3, 3>().determinant());
  return result;
}

}  // namespace

RigFigures compare(const calib::CameraRig& truth, const calib::CameraRig& found,
                   const std::vector<Eigen::Vector3d>& path) {
  std::vector<Eigen::Vector3d> volume;
  for (int i = 0; i <= 8; ++i) {
    for (int j = 0; j <= 8; ++j) {
      for (int k = 0; k <= 8; ++k) volume.emplace_back(-1 + 0.25 * i, -1 + 0.25 * j, 0.1 + 0.25 * k);
    }
  }
  const Aligned world = align(truth, found, volume);
  RigFigures f;
  f.volume_m = world.rms_m;
  f.scale = world.scale;
  if (!path.empty()) f.path_m = align(truth, found, path).rms_m;
  for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
    const Eigen::Vector3d centre = world.rotation * found.cameras[c].centre() + world.translation;
    f.centre_m = std::max(f.centre_m, (centre - truth.cameras[c].centre()).norm());
    const Eigen::Quaterniond q =
        found.cameras[c].cam_from_world.rotation * Eigen::Quaterniond(world.rotation).conjugate();
    f.turned_deg =
        std::max(f.turned_deg, q.angularDistance(truth.cameras[c].cam_from_world.rotation) * 180 / std::numbers::pi);
  }
  return f;
}

}  // namespace huetrack::figures
