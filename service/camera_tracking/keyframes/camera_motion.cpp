#include "camera_tracking/keyframes/camera_motion.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace huetrack::keyframes {

namespace {

// Velocity of a hand-held camera without a measurement, 1 sigma per axis.
constexpr double initial_rad_s = 0.5, initial_m_s = 0.2;
// Acceleration of the calmest filter, 1 sigma per axis, and the ratio from filter to filter. The pose covariances omit
// the map's errors, which neighbouring poses share: the ratio of both is what counts.
constexpr double least_rad_s2 = 2, least_m_s2 = 1, noise_ratio = 4;
constexpr double correlation_s = 0.25;  // of the acceleration (Singer 1970)
// Error of the start's pose that the next poses do not share: a quarter of a pixel.
constexpr double start_rad = 1e-3, start_m = 0.5e-3;
constexpr double longest_interval_s = 0.15;  // a longer gap restarts the filters
// Least velocity sigma of the prior: tremor of the filter.
constexpr double least_rad_s = 0.02, least_m_s = 0.01;
constexpr double nis_kept = 0.8, likelihood_kept = 0.9;  // fading factors, per frame
// Readout sigma where the rig has none, and where the rig has no readout.
constexpr double default_sigma_s = 1e-3, unknown_sigma_s = 20e-3;
// Neighbouring frames see the same points, so that their errors are correlated: so many count as one.
constexpr double frames_per_independent = 4;
constexpr double least_frame_sigma_s = 0.5e-3;  // of one frame's measurement: the motion is not exactly smooth
constexpr double plausible_sigmas = 3;          // larger errors are down-weighted
// Least sigma of the estimate: the errors of the velocities do not average out.
constexpr double least_sigma_share = 0.015, least_sigma_s = 0.15e-3;

// Diagonal, the same for the three axes of rotation and of translation.
Matrix6d per_axis(double rotation, double translation) {
  Matrix6d out = Matrix6d::Zero();
  out.diagonal().head<3>().setConstant(rotation), out.diagonal().tail<3>().setConstant(translation);
  return out;
}

Matrix6d acceleration_variance(std::size_t filter) {
  const double times = std::pow(noise_ratio, static_cast<double>(filter));
  return per_axis(times * times * least_rad_s2 * least_rad_s2, times * times * least_m_s2 * least_m_s2);
}

}  // namespace

calib::Tangent6d MotionPrior::velocity(const calib::Rigid3d& cam_from_world) const {
  return expected_velocity + d_velocity_d_pose * calib::log(cam_from_world * calib::inverse(expected));
}

calib::Tangent6d MotionPrior::bend(const calib::Rigid3d& cam_from_world, double readout_s) const {
  return readout_s * readout_s *
         (expected_acceleration + d_acceleration_d_pose * calib::log(cam_from_world * calib::inverse(expected)));
}

Sweep MotionPrior::sweep(const calib::Rigid3d& cam_from_world, double last_row) const {
  return {readout.mean_s * velocity(cam_from_world), bend(cam_from_world, readout.mean_s), last_row};
}

MotionPrior MotionPrior::without_uncertainty() const {
  MotionPrior out = *this;
  out.readout.sigma_s = 0;
  out.velocity_covariance.setZero();
  return out;
}

Matrix6d MotionPrior::covariance(const calib::Tangent6d& velocity) const {
  const double readout2 = readout.mean_s * readout.mean_s + readout.sigma_s * readout.sigma_s;
  constexpr double least = 1e-7;  // rad, m: so that it can be inverted
  return readout.sigma_s * readout.sigma_s * velocity * velocity.transpose() + readout2 * velocity_covariance +
         least * least * Matrix6d::Identity();
}

void CameraMotion::begin(capture::Timestamp at, const calib::Rigid3d& cam_from_world) {
  last_at_ = at;
  for (std::size_t i = 0; i < filters_.size(); ++i) {
    filters_[i] = {};
    filters_[i].pose = cam_from_world;
    filters_[i].covariance.block<6, 6>(0, 0) = per_axis(start_rad * start_rad, start_m * start_m);
    filters_[i].covariance.block<6, 6>(6, 6) = per_axis(initial_rad_s * initial_rad_s, initial_m_s * initial_m_s);
    filters_[i].covariance.block<6, 6>(12, 12) = acceleration_variance(i);
  }
}

// dt_s < 0: backwards in time.
CameraMotion::Filter CameraMotion::predicted(const Filter& filter, std::size_t index, double dt_s) {
  Filter out = filter;
  const double t = dt_s, s = std::abs(t), kept = std::exp(-s / correlation_s);
  out.pose = calib::exp(calib::Tangent6d(t * filter.velocity + 0.5 * t * t * filter.acceleration)) * filter.pose;
  out.velocity += t * filter.acceleration;
  out.acceleration *= kept;
  Matrix18d f = Matrix18d::Identity();
  f.block<6, 6>(0, 6).diagonal().setConstant(t);
  f.block<6, 6>(0, 12).diagonal().setConstant(0.5 * t * t);
  f.block<6, 6>(6, 12).diagonal().setConstant(t);
  f.block<6, 6>(12, 12).diagonal().setConstant(kept);
  out.covariance = f * filter.covariance * f.transpose();
  // White jerk that keeps the acceleration's variance constant.
  Eigen::Matrix3d white;
  white << s * s * s * s * s / 20, t * s * s * s / 8, s * s * s / 6,  //
      t * s * s * s / 8, s * s * s / 3, t * s / 2,                    //
      s * s * s / 6, t * s / 2, s;
  const Matrix6d per_s = (1 - kept * kept) / s * acceleration_variance(index);
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) out.covariance.block<6, 6>(6 * r, 6 * c) += white(r, c) * per_s;
  return out;
}

void CameraMotion::update(Filter& filter, const calib::Rigid3d& cam_from_world, const Matrix6d& covariance) {
  const calib::Tangent6d innovation = calib::log(cam_from_world * calib::inverse(filter.pose));
  const Eigen::LDLT<Matrix6d> spread(filter.covariance.block<6, 6>(0, 0) + covariance);
  const Eigen::Matrix<double, 18, 6> gain = spread.solve(filter.covariance.topRows<6>()).transpose();
  const double nis = innovation.dot(spread.solve(innovation)) / 6;
  // The covariances are known up to one factor, which is mean_nis.
  const double log_spread = spread.vectorD().array().log().sum() + 6 * std::log(filter.mean_nis);
  filter.log_likelihood = likelihood_kept * filter.log_likelihood - 0.5 * (log_spread + 6 * nis / filter.mean_nis);
  filter.mean_nis += (1 - nis_kept) * (nis - filter.mean_nis);
  const Vector18d step = gain * innovation;
  filter.pose = calib::exp(calib::Tangent6d(step.head<6>())) * filter.pose;
  filter.velocity += step.segment<6>(6), filter.acceleration += step.tail<6>();
  // Joseph's form: stays positive definite although poses are far more certain than accelerations.
  Matrix18d kept = Matrix18d::Identity();
  kept.leftCols<6>() -= gain;
  filter.covariance = Matrix18d(kept * filter.covariance * kept.transpose() + gain * covariance * gain.transpose());
}

void CameraMotion::add(capture::Timestamp at, const calib::Rigid3d& cam_from_world, const Matrix6d& covariance) {
  const double dt_s = last_at_ ? capture::seconds(at - *last_at_) : 0;
  if (!(dt_s > 0 && dt_s < longest_interval_s)) {
    begin(at, cam_from_world);
    return;
  }
  last_at_ = at;
  for (std::size_t i = 0; i < filters_.size(); ++i) {
    filters_[i] = predicted(filters_[i], i, dt_s);
    update(filters_[i], cam_from_world, covariance);
  }
}

MotionPrior CameraMotion::prior(capture::Timestamp at, const Readout& readout) const {
  MotionPrior out;
  out.readout = readout;
  const double dt_s = last_at_ ? capture::seconds(at - *last_at_) : 0;
  if (!(std::abs(dt_s) > 0 && std::abs(dt_s) < longest_interval_s)) {
    out.velocity_covariance = per_axis(initial_rad_s * initial_rad_s, initial_m_s * initial_m_s);
    return out;
  }
  const auto likeliest = std::ranges::max_element(filters_, {}, &Filter::log_likelihood);
  const Filter filter = predicted(*likeliest, static_cast<std::size_t>(likeliest - filters_.begin()), dt_s);
  out.expected = filter.pose;
  out.expected_velocity = filter.velocity, out.expected_acceleration = filter.acceleration;
  // Conditioned on the pose.
  const Eigen::LDLT<Matrix6d> of_pose(filter.covariance.block<6, 6>(0, 0));
  out.d_velocity_d_pose = of_pose.solve(filter.covariance.block<6, 6>(0, 6)).transpose();
  out.d_acceleration_d_pose = of_pose.solve(filter.covariance.block<6, 6>(0, 12)).transpose();
  const Matrix6d given_pose =
      filter.covariance.block<6, 6>(6, 6) - out.d_velocity_d_pose * filter.covariance.block<6, 6>(0, 6);
  out.velocity_covariance = filter.mean_nis * given_pose + per_axis(least_rad_s * least_rad_s, least_m_s * least_m_s);
  return out;
}

MotionPrior CameraMotion::prior_from_next(capture::Timestamp at, capture::Timestamp next_at, const calib::Rigid3d& next,
                                          const Readout& readout) {
  CameraMotion backwards;
  backwards.begin(next_at, next);
  return backwards.prior(at, readout);
}

ReadoutLearner::ReadoutLearner(const calib::CameraTiming& timing)
    : prior_{timing.readout_s.value_or(0.0),
             timing.readout_s ? timing.readout_sigma_s.value_or(default_sigma_s) : unknown_sigma_s},
      averaged_(prior_) {}

void ReadoutLearner::add(const Readout& measured) {
  const double variance = averaged_.sigma_s * averaged_.sigma_s;
  const double own = std::hypot(measured.sigma_s, least_frame_sigma_s);
  const double error =
      std::abs(measured.mean_s - averaged_.mean_s) / std::sqrt(own * own + variance) / plausible_sigmas;
  const double noise = frames_per_independent * own * own * std::max(1.0, error * error);
  const double gain = variance / (variance + noise);
  if (!(gain > 0)) return;
  averaged_.mean_s += gain * (measured.mean_s - averaged_.mean_s);
  averaged_.sigma_s = std::sqrt((1 - gain) * variance);
}

Readout ReadoutLearner::readout() const {
  const double least_s = std::hypot(least_sigma_s, least_sigma_share * averaged_.mean_s);
  return {averaged_.mean_s, std::max(averaged_.sigma_s, std::min(least_s, prior_.sigma_s))};
}

}  // namespace huetrack::keyframes
