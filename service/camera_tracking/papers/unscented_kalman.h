// Unscented Kalman filters (Simon, Optimal State Estimation, 2006): the update for any size, and Lee's feature filter.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <optional>

#include "calib/model/camera_model.h"
#include "calib/model/rigid3.h"

namespace huetrack::papers {

// Updates x, P with y = h(x) + n, n ~ N(0, R): 2 n sigma points at +- the columns of sqrt(n P), equal weights.
//   h(x, y) -> bool     false: this sigma point has no measurement
// false: P is not positive definite, or a sigma point has no measurement; x and P are unchanged.
template <int N, int M, typename Measure>
bool unscented_update(Eigen::Matrix<double, N, 1>& x, Eigen::Matrix<double, N, N>& p,
                      const Eigen::Matrix<double, M, 1>& y, const Eigen::Matrix<double, M, M>& r, const Measure& h) {
  const Eigen::Index n = x.rows(), m = y.rows();
  const Eigen::LLT<Eigen::Matrix<double, N, N>> root(static_cast<double>(n) * p);
  if (root.info() != Eigen::Success) return false;
  const Eigen::Matrix<double, N, N> l = root.matrixL();
  Eigen::Matrix<double, M, Eigen::Dynamic> predicted(m, 2 * n);
  Eigen::Matrix<double, M, 1> z(m);
  Eigen::Matrix<double, M, 1> mean = Eigen::Matrix<double, M, 1>::Zero(m);
  for (Eigen::Index i = 0; i < 2 * n; ++i) {
    const Eigen::Matrix<double, N, 1> sigma =
        i < n ? Eigen::Matrix<double, N, 1>(x + l.col(i)) : Eigen::Matrix<double, N, 1>(x - l.col(i - n));
    if (!h(sigma, z)) return false;
    predicted.col(i) = z;
    mean += z;
  }
  const double weight = 1.0 / static_cast<double>(2 * n);
  mean *= weight;
  Eigen::Matrix<double, M, M> s = r;
  Eigen::Matrix<double, N, M> cross = Eigen::Matrix<double, N, M>::Zero(n, m);
  for (Eigen::Index i = 0; i < 2 * n; ++i) {
    const Eigen::Matrix<double, M, 1> d = predicted.col(i) - mean;
    s += weight * d * d.transpose();
    const Eigen::Matrix<double, N, 1> e =
        i < n ? Eigen::Matrix<double, N, 1>(l.col(i)) : Eigen::Matrix<double, N, 1>(-l.col(i - n));
    cross += weight * e * d.transpose();
  }
  const Eigen::Matrix<double, N, M> gain = s.ldlt().solve(cross.transpose()).transpose();
  x += gain * (y - mean);
  p -= gain * s * gain.transpose();
  p = 0.5 * (p + p.transpose()).eval();
  p.diagonal().array() += 1e-14;
  return true;
}

// Lee's feature estimator: the camera pose at the reference frame (its centre t and quaternion q, cam_from_world), the
// inverse depth along the reference ray, and the reference pixel; eqs. (5)-(9).  thread-compatible.
class FeatureFilter {
 public:
  using State = Eigen::Matrix<double, 10, 1>;  // t (m), q (w x y z), 1/d (1/m), m (raw px)
  using Covariance = Eigen::Matrix<double, 10, 10>;

  // Eqs. (5), (6). camera_covariance: 7x7 of (t, q).
  FeatureFilter(const calib::CameraModel& lens, const calib::Rigid3d& cam_from_world,
                const Eigen::Matrix<double, 7, 7>& camera_covariance, double inverse_depth, double inverse_depth_sigma,
                const Eigen::Vector2d& px, const Eigen::Matrix2d& px_covariance);

  // Eq. (7), world; nullopt: the state has no ray.
  std::optional<Eigen::Vector3d> position() const { return position_of(state_); }
  Eigen::Matrix3d position_covariance() const;    // by the same sigma points
  double depth() const { return 1 / state_[7]; }  // metres, along the reference ray

  // Eqs. (8), (9): measured at px from this pose, r = R_p + covariance of its projections under the particles.
  // false: rejected (above 5 sigmas, or behind the camera).
  bool update(const calib::Rigid3d& cam_from_world, const Eigen::Vector2d& px, const Eigen::Matrix2d& r);
  const State& state() const { return state_; }
  const Covariance& covariance() const { return covariance_; }

 private:
  std::optional<Eigen::Vector3d> position_of(const State& s) const;
  calib::CameraModel lens_;
  State state_;
  Covariance covariance_;
};

}  // namespace huetrack::papers
