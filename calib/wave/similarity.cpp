#include "calib/wave/similarity.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "calib/model/median.h"
#include "calib/solver/umeyama.h"
#include "calib/wave/outline_cost.h"

namespace huetrack::wave {

using Eigen::Matrix3d;
using Eigen::Vector3d;

void Similarity::apply(WaveState& state) const {
  for (calib::Rigid3d& cam_from_world : state.cam_from_world) {
    const Vector3d centre = *this * calib::inverse(cam_from_world).translation;
    const Matrix3d r = cam_from_world.rotation.toRotationMatrix() * rotation.transpose();
    cam_from_world = {Eigen::Quaterniond(r).normalized(), -r * centre};
  }
  for (Vector3d& p : state.path.control) p = *this * p;
}

Similarity onto_rig(const calib::CameraRig& rig, const WaveState& state, bool with_scale) {
  const std::size_t n = rig.cameras.size();
  std::vector<double> weight(n, 1);
  Similarity s;
  for (int round = 0; round < 20; ++round) {
    Matrix3d sum = Matrix3d::Zero();
    Vector3d mean_from = Vector3d::Zero(), mean_to = Vector3d::Zero();
    const double total = std::accumulate(weight.begin(), weight.end(), 0.0);
    for (std::size_t c = 0; c < n; ++c) {
      mean_from += weight[c] / total * calib::inverse(state.cam_from_world[c]).translation;
      mean_to += weight[c] / total * rig.cameras[c].centre();
    }
    double spread_from = 0, spread_to = 0;
    for (std::size_t c = 0; c < n; ++c) {
      const Vector3d from = calib::inverse(state.cam_from_world[c]).translation - mean_from,
                     to = rig.cameras[c].centre() - mean_to;
      spread_from += weight[c] * from.squaredNorm();
      spread_to += weight[c] * to.squaredNorm();
    }
    if (with_scale && spread_from > 0) s.scale = std::sqrt(spread_to / spread_from);
    // Rotation from axes and centres together; a camera's axes count like a lever of 1 m.
    for (std::size_t c = 0; c < n; ++c) {
      const Matrix3d guess = rig.cameras[c].cam_from_world.rotation.toRotationMatrix();
      const Matrix3d found = state.cam_from_world[c].rotation.toRotationMatrix();
      const Vector3d from = calib::inverse(state.cam_from_world[c]).translation - mean_from,
                     to = rig.cameras[c].centre() - mean_to;
      sum += weight[c] * (guess.transpose() * found + s.scale * to * from.transpose());
    }
    const Eigen::JacobiSVD<Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Vector3d sign(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
    s.rotation = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
    s.translation = mean_to - s.scale * (s.rotation * mean_from);
    for (std::size_t c = 0; c < n; ++c) {
      const calib::Rigid3d& pose = state.cam_from_world[c];
      const double off = (s * calib::inverse(pose).translation - rig.cameras[c].centre()).norm();
      const Matrix3d turned = pose.rotation.toRotationMatrix() * s.rotation.transpose();
      const double angle =
          Eigen::AngleAxisd(turned * rig.cameras[c].cam_from_world.rotation.toRotationMatrix().transpose()).angle();
      weight[c] = 1 / std::max(0.002, std::hypot(off, angle));
    }
  }
  return s;
}

Similarity onto_views(const calib::CameraRig& rig, const WaveState& state, const std::vector<BallObservation>& seen,
                      double radius_m, Similarity start) {
  std::vector<Vector3d> places;
  for (const BallObservation& o : seen) places.push_back(state.path.at(state.exposed_s(rig, o.camera, o.t_s, o.px)));
  const auto off = [&](std::size_t i, const Similarity& s) -> std::optional<Eigen::Vector2d> {
    const calib::Camera& camera = rig.cameras[static_cast<std::size_t>(seen[i].camera)];
    const auto px = outline_centre(camera.model, camera.cam_from_world * (s * places[i]), radius_m);
    if (!px) return std::nullopt;
    return Eigen::Vector2d(*px - seen[i].px);
  };
  const auto moved = [&](const Similarity& s, const Eigen::Matrix<double, 6, 1>& by) {
    const Matrix3d turn = rotation_of(by.head<3>());
    return Similarity{s.scale, turn * s.rotation, turn * s.translation + by.tail<3>()};
  };
  constexpr double least_px = 0.3;  // of a camera's rms: below, all cameras are right
  constexpr double step = 1e-5;     // radians or metres, for derivatives
  for (int round = 0; round < 30; ++round) {
    std::vector<std::optional<Eigen::Vector2d>> residuals;
    std::vector<std::vector<double>> squares(rig.cameras.size());
    for (std::size_t i = 0; i < seen.size(); ++i)
      if (const auto& r = residuals.emplace_back(off(i, start)))
        squares[static_cast<std::size_t>(seen[i].camera)].push_back(r->squaredNorm());
    std::vector<double> weight;
    for (auto& of_camera : squares) weight.push_back(1 / std::max(least_px, std::sqrt(calib::median(of_camera))));
    Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> slope = Eigen::Matrix<double, 6, 1>::Zero();
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const auto& r = residuals[i];
      Eigen::Matrix<double, 2, 6> by;
      bool is_seen = r.has_value();
      for (int k = 0; k < 6 && is_seen; ++k) {
        const auto there = off(i, moved(start, step * Eigen::Matrix<double, 6, 1>::Unit(k)));
        is_seen = there.has_value();
        if (is_seen) by.col(k) = (*there - *r) / step;
      }
      if (!is_seen) continue;
      const double w = weight[static_cast<std::size_t>(seen[i].camera)];
      information += w * by.transpose() * by;
      slope += w * by.transpose() * *r;
    }
    const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> solver(information);
    const Eigen::Matrix<double, 6, 1> change = -solver.solve(slope);
    if (solver.info() != Eigen::Success || !change.allFinite()) return start;
    start = moved(start, change);
    if (change.norm() < 1e-9) break;
  }
  return start;
}

Similarity onto_points(const std::vector<Vector3d>& from, const std::vector<Vector3d>& to) {
  Eigen::Matrix3Xd a(3, from.size()), b(3, to.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    a.col(static_cast<Eigen::Index>(i)) = from[i];
    b.col(static_cast<Eigen::Index>(i)) = to[i];
  }
  const Eigen::Matrix4d t = solver::umeyama(a, b, false);
  Similarity s;
  s.scale = std::cbrt(t.topLeftCorner<3, 3>().determinant());
  s.rotation = t.topLeftCorner<3, 3>() / s.scale;
  s.translation = t.topRightCorner<3, 1>();
  return s;
}

}  // namespace huetrack::wave
