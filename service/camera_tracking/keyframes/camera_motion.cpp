#include "camera_tracking/keyframes/camera_motion.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace huetrack::keyframes {

namespace {

// A hand, of which nothing is known yet: per axis.
constexpr double hand_rad_s = 0.5, hand_m_s = 0.2;
// Accelerations of ever more restless hands, and how long they last (Singer 1970). How sure poses are said to be has in
// it what neighbouring ones share, the map's errors, so that the ratio of both is what counts: the largest ones stand
// for hands that jerk.
constexpr double calmest_rad_s2 = 2, calmest_m_s2 = 1, more_restless = 4, lasting_s = 0.25;
// What a start's pose is off that the next ones do not share: a quarter of a pixel.
constexpr double start_rad = 1e-3, start_m = 0.5e-3;
constexpr double longest_interval_s = 0.15;  // longer, and the motion before says nothing about that after
// However evenly it moved, a hand trembles.
constexpr double least_rad_s = 0.02, least_m_s = 0.01;
constexpr double surprise_kept = 0.8, likelihood_kept = 0.9;  // from frame to frame
// What a rig says without a standard deviation, and a camera of which no rig says anything.
constexpr double known_sigma_s = 1e-3, unknown_sigma_s = 20e-3;
// Neighbouring frames see the same points, whose errors are alike: so many of them say as much as one.
constexpr double frames_alike = 4;
constexpr double least_frame_sigma_s = 0.5e-3;  // of what one frame says: the motion between rows is not that even
constexpr double plausible_sigmas = 3;
// No number of frames tells it better than this: velocities are differences of poses, whose errors are no part of this.
constexpr double least_sigma_share = 0.015, least_sigma_s = 0.15e-3;

// The same for the three axes of turns and of shifts.
Matrix6d per_axis(double turn, double shift) {
  Matrix6d out = Matrix6d::Zero();
  out.diagonal().head<3>().setConstant(turn), out.diagonal().tail<3>().setConstant(shift);
  return out;
}

// The variances of a hand's accelerations.
Matrix6d restlessness(std::size_t hand) {
  const double times = std::pow(more_restless, static_cast<double>(hand));
  return per_axis(times * times * calmest_rad_s2 * calmest_rad_s2, times * times * calmest_m_s2 * calmest_m_s2);
}

}  // namespace

calib::Tangent6d MotionPrior::velocity(const calib::Rigid3d& cam_from_world) const {
  return velocity_there + velocity_by_pose * calib::log(cam_from_world * calib::inverse(expected));
}

calib::Tangent6d MotionPrior::bend(const calib::Rigid3d& cam_from_world, double readout_s) const {
  return readout_s * readout_s *
         (acceleration_there + acceleration_by_pose * calib::log(cam_from_world * calib::inverse(expected)));
}

camera_tracking::Sweep MotionPrior::sweep(const calib::Rigid3d& cam_from_world, double last_row) const {
  return {readout.mean_s * velocity(cam_from_world), bend(cam_from_world, readout.mean_s), last_row};
}

MotionPrior MotionPrior::held() const {
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

void CameraMotion::forget() {
  *this = {};
}

void CameraMotion::begin(capture::Timestamp at, const calib::Rigid3d& cam_from_world) {
  last_at_ = at;
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    hands_[i] = {};
    hands_[i].pose = cam_from_world;
    hands_[i].covariance.block<6, 6>(0, 0) = per_axis(start_rad * start_rad, start_m * start_m);
    hands_[i].covariance.block<6, 6>(6, 6) = per_axis(hand_rad_s * hand_rad_s, hand_m_s * hand_m_s);
    hands_[i].covariance.block<6, 6>(12, 12) = restlessness(i);
  }
}

// length_s < 0: backwards.
CameraMotion::Hand CameraMotion::ahead(const Hand& hand, std::size_t which, double length_s) {
  Hand out = hand;
  const double t = length_s, s = std::abs(t), left = std::exp(-s / lasting_s);
  out.pose = calib::exp(calib::Tangent6d(t * hand.velocity + 0.5 * t * t * hand.acceleration)) * hand.pose;
  out.velocity += t * hand.acceleration;
  out.acceleration *= left;
  Matrix18d f = Matrix18d::Identity();
  f.block<6, 6>(0, 6).diagonal().setConstant(t);
  f.block<6, 6>(0, 12).diagonal().setConstant(0.5 * t * t);
  f.block<6, 6>(6, 12).diagonal().setConstant(t);
  f.block<6, 6>(12, 12).diagonal().setConstant(left);
  out.covariance = f * hand.covariance * f.transpose();
  // What keeps accelerations as large as they are, as white noise over the interval.
  Eigen::Matrix3d white;
  white << s * s * s * s * s / 20, t * s * s * s / 8, s * s * s / 6,  //
      t * s * s * s / 8, s * s * s / 3, t * s / 2,                    //
      s * s * s / 6, t * s / 2, s;
  const Matrix6d per_s = (1 - left * left) / s * restlessness(which);
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) out.covariance.block<6, 6>(6 * r, 6 * c) += white(r, c) * per_s;
  return out;
}

void CameraMotion::observe(Hand& hand, const calib::Rigid3d& cam_from_world, const Matrix6d& covariance) {
  const calib::Tangent6d off = calib::log(cam_from_world * calib::inverse(hand.pose));
  const Eigen::LDLT<Matrix6d> spread(hand.covariance.block<6, 6>(0, 0) + covariance);
  const Eigen::Matrix<double, 18, 6> gain = spread.solve(hand.covariance.topRows<6>()).transpose();
  const double off2 = off.dot(spread.solve(off)) / 6;
  // All covariances of a hand have one unknown factor: the surprise.
  const double log_spread = spread.vectorD().array().log().sum() + 6 * std::log(hand.surprise);
  hand.log_likelihood = likelihood_kept * hand.log_likelihood - 0.5 * (log_spread + 6 * off2 / hand.surprise);
  hand.surprise += (1 - surprise_kept) * (off2 - hand.surprise);
  const Vector18d step = gain * off;
  hand.pose = calib::exp(calib::Tangent6d(step.head<6>())) * hand.pose;
  hand.velocity += step.segment<6>(6), hand.acceleration += step.tail<6>();
  // Joseph's form: the short one loses its definiteness, for poses are known by far better than accelerations.
  Matrix18d kept = Matrix18d::Identity();
  kept.leftCols<6>() -= gain;
  hand.covariance = Matrix18d(kept * hand.covariance * kept.transpose() + gain * covariance * gain.transpose());
}

void CameraMotion::add(capture::Timestamp at, const calib::Rigid3d& cam_from_world, const Matrix6d& covariance) {
  const double length_s = last_at_ ? capture::seconds(at - *last_at_) : 0;
  if (!(length_s > 0 && length_s < longest_interval_s)) {
    begin(at, cam_from_world);
    return;
  }
  last_at_ = at;
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    hands_[i] = ahead(hands_[i], i, length_s);
    observe(hands_[i], cam_from_world, covariance);
  }
}

MotionPrior CameraMotion::prior(capture::Timestamp at, const Readout& readout) const {
  MotionPrior out;
  out.readout = readout;
  const double length_s = last_at_ ? capture::seconds(at - *last_at_) : 0;
  if (!(std::abs(length_s) > 0 && std::abs(length_s) < longest_interval_s)) {
    out.velocity_covariance = per_axis(hand_rad_s * hand_rad_s, hand_m_s * hand_m_s);
    return out;
  }
  const auto likeliest = std::ranges::max_element(hands_, {}, &Hand::log_likelihood);
  const Hand hand = ahead(*likeliest, static_cast<std::size_t>(likeliest - hands_.begin()), length_s);
  out.expected = hand.pose;
  out.velocity_there = hand.velocity, out.acceleration_there = hand.acceleration;
  // What goes with a pose beside the expected one, and what is left open when the pose is known.
  const Eigen::LDLT<Matrix6d> of_pose(hand.covariance.block<6, 6>(0, 0));
  out.velocity_by_pose = of_pose.solve(hand.covariance.block<6, 6>(0, 6)).transpose();
  out.acceleration_by_pose = of_pose.solve(hand.covariance.block<6, 6>(0, 12)).transpose();
  const Matrix6d open = hand.covariance.block<6, 6>(6, 6) - out.velocity_by_pose * hand.covariance.block<6, 6>(0, 6);
  out.velocity_covariance = hand.surprise * open + per_axis(least_rad_s * least_rad_s, least_m_s * least_m_s);
  return out;
}

MotionPrior CameraMotion::prior_from_next(capture::Timestamp at, capture::Timestamp next_at, const calib::Rigid3d& next,
                                          const Readout& readout) {
  CameraMotion backwards;
  backwards.begin(next_at, next);
  return backwards.prior(at, readout);
}

ReadoutLearner::ReadoutLearner(const calib::CameraTiming& timing)
    : told_{timing.readout_s.value_or(0.0),
            timing.readout_s ? timing.readout_sigma_s.value_or(known_sigma_s) : unknown_sigma_s},
      averaged_(told_) {}

void ReadoutLearner::add(const Readout& measured) {
  const double variance = averaged_.sigma_s * averaged_.sigma_s;
  const double own = std::hypot(measured.sigma_s, least_frame_sigma_s);
  // What contradicts all that was learnt counts for less, the more it does.
  const double surprise =
      std::abs(measured.mean_s - averaged_.mean_s) / std::sqrt(own * own + variance) / plausible_sigmas;
  const double noise = frames_alike * own * own * std::max(1.0, surprise * surprise);
  const double gain = variance / (variance + noise);
  if (!(gain > 0)) return;
  averaged_.mean_s += gain * (measured.mean_s - averaged_.mean_s);
  averaged_.sigma_s = std::sqrt((1 - gain) * variance);
}

Readout ReadoutLearner::readout() const {
  const double least_s = std::hypot(least_sigma_s, least_sigma_share * averaged_.mean_s);
  return {averaged_.mean_s, std::max(averaged_.sigma_s, std::min(least_s, told_.sigma_s))};
}

}  // namespace huetrack::keyframes
