#include "camera_tracking/papers/unscented_kalman.h"

#include <Eigen/LU>
#include <algorithm>

namespace huetrack::papers {

FeatureFilter::FeatureFilter(const calib::CameraModel& lens, const calib::Rigid3d& cam_from_world,
                             const Eigen::Matrix<double, 7, 7>& camera_covariance, double inverse_depth,
                             double inverse_depth_sigma, const Eigen::Vector2d& px,
                             const Eigen::Matrix2d& px_covariance)
    : lens_(lens), covariance_(Covariance::Zero()) {
  const Eigen::Quaterniond& q = cam_from_world.rotation;
  state_ << calib::inverse(cam_from_world).translation, q.w(), q.x(), q.y(), q.z(), inverse_depth, px;
  covariance_.topLeftCorner<7, 7>() = camera_covariance;
  covariance_.diagonal().head<7>().array() += 1e-10;  // a quaternion's covariance is singular
  covariance_(7, 7) = inverse_depth_sigma * inverse_depth_sigma;
  covariance_.bottomRightCorner<2, 2>() = px_covariance;
}

std::optional<Eigen::Vector3d> FeatureFilter::position_of(const State& s) const {
  const auto ray = lens_.ray({Eigen::Vector2d(s.tail<2>())});
  if (!ray) return std::nullopt;
  const Eigen::Quaterniond q = Eigen::Quaterniond(s[3], s[4], s[5], s[6]).normalized();
  return Eigen::Vector3d(s.head<3>() + q.conjugate() * *ray / std::max(s[7], 1e-4));
}

Eigen::Matrix3d FeatureFilter::position_covariance() const {
  const Eigen::LLT<Covariance> root(10.0 * covariance_);
  const Covariance l = root.matrixL();
  const auto mean = position();
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  if (!mean || root.info() != Eigen::Success) return Eigen::Matrix3d::Identity();
  for (int i = 0; i < 20; ++i) {
    const State s = i < 10 ? State(state_ + l.col(i)) : State(state_ - l.col(i - 10));
    if (const auto p = position_of(s)) sum += (*p - *mean) * (*p - *mean).transpose() / 20;
  }
  return sum;
}

bool FeatureFilter::update(const calib::Rigid3d& cam_from_world, const Eigen::Vector2d& px, const Eigen::Matrix2d& r) {
  State x = state_;
  Covariance p = covariance_;
  const auto at = position();
  if (!at) return false;
  const auto seen = lens_.project(cam_from_world * *at);
  if (!seen) return false;
  const auto measure = [&](const State& s, Eigen::Vector2d& y) {
    const auto point = position_of(s);
    if (!point) return false;
    const auto pixel = lens_.project(cam_from_world * *point);
    if (!pixel) return false;
    y = pixel->px;
    return true;
  };
  const Eigen::Vector2d innovation = px - seen->px;
  if (!unscented_update<10, 2>(x, p, px, r, measure)) return false;
  // Gate with the innovation covariance S = R + D P D^T.
  Eigen::Matrix3d spread = position_covariance();
  calib::CameraModel::Jacobian j;
  lens_.project(cam_from_world * *at, j);
  const Eigen::Matrix<double, 2, 3> d = j * cam_from_world.rotation.toRotationMatrix();
  const Eigen::Matrix2d s = r + d * spread * d.transpose();
  if (innovation.dot(s.inverse() * innovation) > 25) return false;
  x.segment<4>(3).normalize();
  x[7] = std::max(x[7], 1e-4);
  state_ = x, covariance_ = p;
  return true;
}

}  // namespace huetrack::papers
