#include "object_tracking/motion_belief.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace huetrack::object_tracking {
namespace {

// Of a camera of which the rig tells nothing. Drivers stamp 0 to 45 ms after mid-exposure, evenly spread that is 13 ms
// of standard deviation, and the difference of two cameras 18.
constexpr double unknown_latency_sigma_s = 0.020;
// Rolling shutters take 10 to 33 ms, global ones nothing, and either may be mounted upside down.
constexpr double unknown_readout_sigma_s = 0.020;
// Of a number that somebody wrote into the rig without saying how well it is known.
constexpr double unstated_sigma_s = 0.002;
// Mid-exposure moves with the exposure time, which lamps and clouds make a camera change: a millisecond in a minute or
// two. A sensor's readout stays what it is.
constexpr double latency_walk_s2_per_s = 1e-4 * 1e-4;
// However long one looks, the errors of a view's sightings are not all new: light from one side and the flicker of
// lamps shift what is seen by up to 0.3 ms of way, the same again and again (flicker weighs the moments of an
// exposure).
constexpr double least_latency_sigma_s = 3e-4, least_readout_sigma_s = 8e-4;

double variance_of(const std::optional<double>& value, const std::optional<double>& sigma, double unknown_sigma_s) {
  const double s = sigma.value_or(value ? unstated_sigma_s : unknown_sigma_s);
  return s * s;
}

}  // namespace

MotionBelief::MotionBelief(const calib::CameraRig& rig, bool times_are_learnt) : times_are_learnt_(times_are_learnt) {
  const auto cameras = static_cast<Eigen::Index>(rig.cameras.size());
  const Eigen::Index n = times_are_learnt ? 6 + 2 * cameras : 6;
  mean_ = Eigen::VectorXd::Zero(n);
  covariance_ = Eigen::MatrixXd::Zero(n, n);
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const calib::CameraTiming& timing = rig.cameras[c].timing;
    Given given{.latency_s = timing.latency_s.value_or(0), .readout_s = timing.readout_s.value_or(0)};
    if (times_are_learnt) {
      const Eigen::Index latency = latency_of(static_cast<int>(c));
      if (static_cast<int>(c) != reference_camera)
        covariance_(latency, latency) = variance_of(timing.latency_s, timing.latency_sigma_s, unknown_latency_sigma_s);
      covariance_(latency + 1, latency + 1) =
          variance_of(timing.readout_s, timing.readout_sigma_s, unknown_readout_sigma_s);
    } else {
      given.latency_variance_s2 = std::pow(timing.latency_sigma_s.value_or(0), 2);
      given.readout_variance_s2 = std::pow(timing.readout_sigma_s.value_or(0), 2);
    }
    given_.push_back(given);
  }
}

double MotionBelief::row_shift_s(int camera, double below_middle) const {
  if (!times_are_learnt_) return 0;
  const Eigen::Index latency = latency_of(camera);
  return below_middle * mean_(latency + 1) - mean_(latency);
}

double MotionBelief::row_sigma_s(int camera, double below_middle) const {
  const Given& given = given_[static_cast<std::size_t>(camera)];
  double variance = given.latency_variance_s2 + below_middle * below_middle * given.readout_variance_s2;
  if (times_are_learnt_) {
    const Eigen::Index l = latency_of(camera), r = l + 1;
    variance +=
        covariance_(l, l) - 2 * below_middle * covariance_(l, r) + below_middle * below_middle * covariance_(r, r);
  }
  return std::sqrt(std::max(0.0, variance));
}

CameraTimingEstimate MotionBelief::timing(int camera) const {
  const Given& given = given_[static_cast<std::size_t>(camera)];
  if (!times_are_learnt_)
    return {given.latency_s, std::sqrt(given.latency_variance_s2), given.readout_s,
            std::sqrt(given.readout_variance_s2)};
  const Eigen::Index l = latency_of(camera), r = l + 1;
  return {given.latency_s + mean_(l), std::sqrt(covariance_(l, l)), given.readout_s + mean_(r),
          std::sqrt(covariance_(r, r))};
}

void MotionBelief::begin(capture::Timestamp when, const Eigen::Vector3d& position, double position_variance,
                         const Eigen::Vector3d& velocity, double velocity_variance) {
  at = when;
  mean_.head<3>() = position;
  mean_.segment<3>(3) = velocity;
  covariance_.topRows<6>().setZero();
  covariance_.leftCols<6>().setZero();
  covariance_.diagonal().head<3>().setConstant(position_variance);
  covariance_.diagonal().segment<3>(3).setConstant(velocity_variance);
}

void MotionBelief::predict_to(capture::Timestamp when, double power_density) {
  const double dt = capture::seconds(when - at);
  if (dt <= 0) return;
  at = when;
  mean_.head<3>() += dt * mean_.segment<3>(3);
  covariance_.topRows<3>() += dt * covariance_.middleRows<3>(3);
  covariance_.leftCols<3>() += dt * covariance_.middleCols<3>(3);
  const double q = power_density;
  covariance_.diagonal().head<3>().array() += q * dt * dt * dt / 3;
  covariance_.diagonal().segment<3>(3).array() += q * dt;
  covariance_.block<3, 3>(0, 3).diagonal().array() += q * dt * dt / 2;
  covariance_.block<3, 3>(3, 0).diagonal().array() += q * dt * dt / 2;
  if (!times_are_learnt_) return;
  for (int c = 0; c < static_cast<int>(given_.size()); ++c) {
    if (c != reference_camera) covariance_(latency_of(c), latency_of(c)) += latency_walk_s2_per_s * dt;
  }
}

MotionBelief::Seen MotionBelief::seen(const SeenRow& row, const Eigen::Vector3d& velocity, double power_density) const {
  const double dt = capture::seconds(row.at - at);
  Seen out{.with_state = covariance_.topRows<3>() + dt * covariance_.middleRows<3>(3), .covariance = {}};
  const Given& given = given_[static_cast<std::size_t>(row.camera)];
  double time_variance_s2 = given.latency_variance_s2 + row.below_middle * row.below_middle * given.readout_variance_s2;
  const Eigen::Index latency = latency_of(row.camera);
  if (times_are_learnt_)
    out.with_state += velocity * (row.below_middle * covariance_.row(latency + 1) - covariance_.row(latency));
  out.covariance = out.with_state.leftCols<3>() + dt * out.with_state.middleCols<3>(3);
  if (times_are_learnt_)
    out.covariance +=
        (row.below_middle * out.with_state.col(latency + 1) - out.with_state.col(latency)) * velocity.transpose();
  out.covariance += time_variance_s2 * velocity * velocity.transpose();
  out.covariance.diagonal().array() += power_density * std::abs(dt * dt * dt) / 3;  // what it may swerve meanwhile
  return out;
}

Eigen::Matrix3d MotionBelief::seen_covariance(const SeenRow& row, double power_density) const {
  return seen(row, velocity(), power_density).covariance;
}

double MotionBelief::observe(const LinearSighting& sighting, const Eigen::Vector3d& velocity, double power_density) {
  const SeenRow& row = sighting.row;
  const Seen predicted = seen(row, velocity, power_density);
  const double later_s = row_shift_s(row.camera, row.below_middle) - row.shift_s;
  const Eigen::Vector3d position_then =
      position() + capture::seconds(row.at - at) * this->velocity() + later_s * velocity;
  const Eigen::Vector2d innovation =
      sighting.px - sighting.px_expected - sighting.jacobian * (position_then - sighting.linearised_at);
  const Eigen::Matrix2d s =
      sighting.jacobian * predicted.covariance * sighting.jacobian.transpose() + sighting.covariance;
  const Eigen::Matrix2d information = s.inverse();
  const Eigen::Matrix<double, 2, Eigen::Dynamic> px_with_state = sighting.jacobian * predicted.with_state;
  const Eigen::Matrix<double, Eigen::Dynamic, 2> gain = px_with_state.transpose() * information;
  const Eigen::VectorXd variance_before = covariance_.diagonal();
  mean_ += gain * innovation;
  covariance_.noalias() -= gain * px_with_state;
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
  if (times_are_learnt_) {
    const auto keep = [&](Eigen::Index i, double least_sigma) {
      covariance_(i, i) = std::max(covariance_(i, i), std::min(variance_before(i), least_sigma * least_sigma));
    };
    for (int c = 0; c < static_cast<int>(given_.size()); ++c) {
      keep(latency_of(c), least_latency_sigma_s);
      keep(latency_of(c) + 1, least_readout_sigma_s);
    }
  }
  return innovation.dot(information * innovation);
}

Eigen::Matrix3d MotionBelief::position_covariance_given_times() const {
  const Eigen::Index n = size() - 6;
  if (n == 0) return position_covariance();
  Eigen::MatrixXd times = covariance_.bottomRightCorner(n, n);
  times.diagonal().array() += 1e-16;  // s^2: of those that are held
  const Eigen::MatrixXd with_position = covariance_.bottomLeftCorner(n, 3);
  return position_covariance() - with_position.transpose() * times.llt().solve(with_position);
}

void MotionBelief::set_position(const Eigen::Vector3d& mean, const Eigen::Matrix3d& covariance) {
  const Eigen::Matrix3d before = position_covariance();
  const Eigen::Index rest = size() - 3;
  const Eigen::Matrix<double, Eigen::Dynamic, 3> regression = covariance_.bottomLeftCorner(rest, 3) * before.inverse();
  mean_.tail(rest) += regression * (mean - position());
  mean_.head<3>() = mean;
  covariance_.bottomRightCorner(rest, rest) += regression * (covariance - before) * regression.transpose();
  covariance_.topLeftCorner<3, 3>() = covariance;
  covariance_.bottomLeftCorner(rest, 3) = regression * covariance;
  covariance_.topRightCorner(3, rest) = covariance_.bottomLeftCorner(rest, 3).transpose();
}

MotionBelief::SeenPosition MotionBelief::seen_given_position(const SeenRow& row, double power_density) const {
  const Eigen::Vector3d v = velocity();
  const Seen all = seen(row, v, power_density);
  const double later_s = row_shift_s(row.camera, row.below_middle) - row.shift_s;
  SeenPosition out;
  out.slope = all.with_state.leftCols<3>() * position_covariance().inverse();
  out.offset = position() + (capture::seconds(row.at - at) + later_s) * v - out.slope * position();
  out.covariance = all.covariance - out.slope * all.with_state.leftCols<3>().transpose();
  out.covariance = (0.5 * (out.covariance + out.covariance.transpose())).eval();
  return out;
}

}  // namespace huetrack::object_tracking
