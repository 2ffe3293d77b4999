#include "camera_tracking/keyframes/swept_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "calib/model/median.h"

namespace huetrack::keyframes {

namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix12d = Eigen::Matrix<double, 12, 12>;
using Vector12d = Eigen::Matrix<double, 12, 1>;

constexpr double most_step_rad = 1, most_step_m = 10;  // a larger step has diverged
constexpr double done_rad = 1e-7, done_m = 1e-7;

// Normal equations of pose and motion: of the observations (at unit scale) or of the prior.
struct Normal {
  Matrix12d h = Matrix12d::Zero();
  Vector12d b = Vector12d::Zero();
};

class Fit {
 public:
  Fit(const calib::CameraModel& lens, std::span<const PoseObservation> observations, const SweptPose& start,
      const MotionPrior& prior);
  SweptFit run(int iterations) {
    iterate(iterations);
    out_.fit.cam_from_world = out_.pose.cam_from_world;
    return std::move(out_);
  }

 private:
  void iterate(int iterations);
  bool linearise();  // residuals and Jacobians; false: too few points in front of the camera
  Normal of_observations();
  Normal of_prior();
  std::optional<Readout> readout_of(const Matrix12d& covariance) const;

  const calib::CameraModel& lens_;
  std::span<const PoseObservation> observations_;
  const MotionPrior& prior_;
  SweptFit out_;
  std::vector<Eigen::Vector2d> residual_;
  std::vector<Eigen::Matrix<double, 2, 6>> jacobian_;  // of the row's pose
  std::vector<double> fraction_, lengths_;
  // The prior, at the current pose.
  Vector6d velocity_ = Vector6d::Zero();
  Matrix6d prior_information_ = Matrix6d::Zero();
  double readout_s_ = 0;
};

Fit::Fit(const calib::CameraModel& lens, std::span<const PoseObservation> observations, const SweptPose& start,
         const MotionPrior& prior)
    : lens_(lens), observations_(observations), prior_(prior) {
  const std::size_t n = observations.size();
  out_.pose = start;
  out_.fit.error.assign(n, std::numeric_limits<double>::infinity());
  out_.fit.weight.assign(n, 0);
  residual_.resize(n), jacobian_.resize(n), fraction_.resize(n);
  for (std::size_t i = 0; i < n; ++i) fraction_[i] = start.sweep.fraction(observations[i].px.y());
}

bool Fit::linearise() {
  PoseFit& fit = out_.fit;
  const Sweep& sweep = out_.pose.sweep;
  const bool is_swept = !sweep.is_zero();
  lengths_.clear();
  for (std::size_t i = 0; i < observations_.size(); ++i) {
    const PoseObservation& o = observations_[i];
    Eigen::Vector3d p = out_.pose.cam_from_world * o.p_world;
    if (is_swept) p = sweep.row_from_middle(o.px.y()) * p;
    calib::CameraModel::Jacobian j;
    const auto seen = lens_.project(p, j);
    fit.error[i] = std::numeric_limits<double>::infinity();
    if (!seen) continue;
    residual_[i] = (seen->px - o.px) / o.sigma_px;
    jacobian_[i] = pose_jacobian(j, p) / o.sigma_px;
    if (const double line2 = o.line_sigma_px.squaredNorm(); line2 > 0) {  // larger sigma in that direction
      const double left = 1 / std::sqrt(1 + line2 / (o.sigma_px * o.sigma_px));
      const Eigen::Matrix2d less =
          Eigen::Matrix2d::Identity() - (1 - left) / line2 * o.line_sigma_px * o.line_sigma_px.transpose();
      residual_[i] = less * residual_[i], jacobian_[i] = less * jacobian_[i];
    }
    fit.error[i] = residual_[i].norm();
    if (o.line_sigma_px.isZero(0)) lengths_.push_back(fit.error[i]);
  }
  if (lengths_.size() < 3) return false;
  fit.scale = calib::median_in_place(std::span(lengths_)) / rayleigh_median;
  return true;
}

// To first order, d residual / d motion = fraction(row) * d residual / d pose.
Normal Fit::of_observations() {
  PoseFit& fit = out_.fit;
  const double width = tukey * std::max(fit.scale, least_scale);
  Normal n;
  Matrix6d pose = Matrix6d::Zero(), both = Matrix6d::Zero(), motion = Matrix6d::Zero();
  fit.inliers = 0;
  for (std::size_t i = 0; i < observations_.size(); ++i) {
    const double x = fit.error[i] / width;
    const double w = x < 1 ? (1 - x * x) * (1 - x * x) : 0;
    fit.weight[i] = w;
    if (w <= 0) continue;
    fit.inliers += w > inlier_weight;
    const Matrix6d h = w * jacobian_[i].transpose() * jacobian_[i];
    const Vector6d b = w * jacobian_[i].transpose() * residual_[i];
    pose += h, both += fraction_[i] * h, motion += fraction_[i] * fraction_[i] * h;
    n.b.head<6>() += b, n.b.tail<6>() += fraction_[i] * b;
  }
  n.h << pose, both, both, motion;
  return n;
}

Normal Fit::of_prior() {
  velocity_ = prior_.velocity(out_.pose.cam_from_world);
  const Vector6d residual = out_.pose.sweep.motion - prior_.readout.mean_s * velocity_;
  prior_information_ = prior_.covariance(velocity_).llt().solve(Matrix6d::Identity());
  const Vector6d b = prior_information_ * residual;
  // The readout's posterior mean given this motion; it couples motion and pose.
  readout_s_ = prior_.readout.mean_s + prior_.readout.sigma_s * prior_.readout.sigma_s * velocity_.dot(b);
  out_.pose.sweep.bend = prior_.bend(out_.pose.cam_from_world, readout_s_);
  const Matrix6d by_pose = readout_s_ * prior_.d_velocity_d_pose;
  const Matrix6d coupled = by_pose.transpose() * prior_information_;
  Normal n;
  n.h << coupled * by_pose, -coupled, -coupled.transpose(), prior_information_;
  n.b << -by_pose.transpose() * b, b;
  return n;
}

// The readout's posterior (from the motion's residual along the velocity), with its prior removed.
std::optional<Readout> Fit::readout_of(const Matrix12d& covariance) const {
  constexpr double least_information = 1e-3;  // of the prior's
  const double variance = prior_.readout.sigma_s * prior_.readout.sigma_s;
  if (!(variance > 0)) return std::nullopt;
  const Matrix6d by_pose = readout_s_ * prior_.d_velocity_d_pose;
  const Vector6d gain = variance * prior_information_ * velocity_;
  const Matrix6d of_both = by_pose * covariance.topRightCorner<6, 6>();
  const Matrix6d of_residual = by_pose * covariance.topLeftCorner<6, 6>() * by_pose.transpose() - of_both -
                               of_both.transpose() + covariance.bottomRightCorner<6, 6>();
  const double left = variance - variance * gain.dot(velocity_) + gain.dot(of_residual * gain);
  if (!(left > 0) || !(1 / left - 1 / variance > least_information / variance)) return std::nullopt;
  const double own = 1 / (1 / left - 1 / variance);
  return Readout{prior_.readout.mean_s + (readout_s_ - prior_.readout.mean_s) * own / left, std::sqrt(own)};
}

void Fit::iterate(int iterations) {
  for (int iteration = 0; iteration <= iterations; ++iteration) {
    if (!linearise()) return;
    const Normal seen = of_observations(), known = of_prior();
    const double scale = std::max(1.0, out_.fit.scale), scale2 = scale * scale;
    Matrix12d h = seen.h / scale2 + known.h;
    if (iteration == iterations) {
      const Eigen::LDLT<Matrix6d> motion(h.bottomRightCorner<6, 6>());
      out_.fit.information =
          scale2 * (h.topLeftCorner<6, 6>() - h.topRightCorner<6, 6>() * motion.solve(h.bottomLeftCorner<6, 6>()));
      const Eigen::LDLT<Matrix12d> whole(h);
      if (whole.isPositive()) out_.readout = readout_of(whole.solve(Matrix12d::Identity()));
      break;
    }
    h.diagonal() *= 1 + 1e-9;
    const Vector12d step = -h.ldlt().solve(seen.b / scale2 + known.b);
    if (!step.allFinite() || step.head<3>().norm() > most_step_rad || step.segment<3>(3).norm() > most_step_m) return;
    out_.pose.cam_from_world = calib::exp(Vector6d(step.head<6>())) * out_.pose.cam_from_world;
    out_.pose.sweep.motion += step.tail<6>();
    if (step.head<3>().norm() < done_rad && step.segment<3>(3).norm() < done_m && iteration > 1)
      iteration = iterations - 1;
  }
}

}  // namespace

SweptFit refine_swept_pose(const calib::CameraModel& lens, std::span<const PoseObservation> observations,
                           const SweptPose& start, const MotionPrior& prior, int iterations) {
  return Fit(lens, observations, start, prior).run(iterations);
}

}  // namespace huetrack::keyframes
