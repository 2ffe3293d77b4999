#include "camera_tracking/keyframes/camera_motion.h"

#include <algorithm>
#include <cmath>

namespace huetrack::keyframes {

namespace {

// A hand, of which nothing is known yet: per axis.
constexpr double hand_rad_s = 0.5, hand_m_s = 0.2, hand_rad_s2 = 8, hand_m_s2 = 4;
constexpr double longest_interval_s = 0.15;  // longer, and the motion before says nothing about that after
// However evenly it moved, a hand trembles.
constexpr double least_rad_s = 0.02, least_m_s = 0.01;
constexpr double change_kept = 0.8;  // of the mean square, from frame to frame
// With a steady change of the acceleration, velocities that go on with the acceleration before are off by a third of
// what the next one then departs from them.
constexpr double off_by_share_of_change = 1.0 / 3;
// What a rig says without a standard deviation, and a camera of which no rig says anything.
constexpr double known_sigma_s = 1e-3, unknown_sigma_s = 20e-3;
// Neighbouring frames see the same points, whose errors are alike: so many of them say as much as one.
constexpr double frames_alike = 3;
constexpr double least_frame_sigma_s = 0.5e-3;  // of what one frame says: the motion between rows is not that even
constexpr double plausible_sigmas = 3;
// No number of frames tells it better than this: velocities are differences of poses, whose errors are no part of this.
constexpr double least_sigma_share = 0.015, least_sigma_s = 0.15e-3;

}  // namespace

calib::Tangent6d MotionPrior::velocity(const calib::Rigid3d& cam_from_world) const {
  const calib::Tangent6d mean = per_frame_hz * calib::log(cam_from_world * calib::inverse(before));
  return mean + kept * (mean - velocity_before);
}

calib::Tangent6d MotionPrior::bend(const calib::Rigid3d& cam_from_world, double readout_s) const {
  if (kept <= 0) return calib::Tangent6d::Zero();
  const calib::Tangent6d mean = per_frame_hz * calib::log(cam_from_world * calib::inverse(before));
  return readout_s * readout_s / accelerating_s * (mean - velocity_before);
}

camera_tracking::Sweep MotionPrior::sweep(const calib::Rigid3d& cam_from_world, double last_row) const {
  return {readout.mean_s * velocity(cam_from_world), bend(cam_from_world, readout.mean_s), last_row};
}

MotionPrior MotionPrior::held() const {
  MotionPrior out = *this;
  out.readout.sigma_s = out.turn_sigma_rad_s = out.shift_sigma_m_s = 0;
  return out;
}

Matrix6d MotionPrior::covariance(const calib::Tangent6d& velocity) const {
  const double readout2 = readout.mean_s * readout.mean_s + readout.sigma_s * readout.sigma_s;
  Matrix6d out = readout.sigma_s * readout.sigma_s * velocity * velocity.transpose();
  constexpr double least = 1e-7;  // rad, m: so that it can be inverted
  out.diagonal().head<3>().array() += readout2 * turn_sigma_rad_s * turn_sigma_rad_s + least * least;
  out.diagonal().tail<3>().array() += readout2 * shift_sigma_m_s * shift_sigma_m_s + least * least;
  return out;
}

void CameraMotion::forget() {
  *this = {};
}

void CameraMotion::add(capture::Timestamp at, const calib::Rigid3d& cam_from_world) {
  const double length_s = last_at_ ? capture::seconds(at - *last_at_) : 0;
  if (!(length_s > 0 && length_s < longest_interval_s)) {
    forget();
  } else {
    const calib::Tangent6d velocity = calib::log(cam_from_world * calib::inverse(last_pose_)) / length_s;
    if (last_interval_) {
      const calib::Tangent6d change = velocity - last_interval_->velocity;
      const calib::Tangent6d surprise = last_change_ ? calib::Tangent6d(change - *last_change_) : change;
      turn_change_ += (1 - change_kept) * (surprise.head<3>().squaredNorm() / 3 - turn_change_);
      shift_change_ += (1 - change_kept) * (surprise.tail<3>().squaredNorm() / 3 - shift_change_);
      last_change_ = change;
    }
    last_interval_ = {velocity, length_s};
  }
  last_at_ = at, last_pose_ = cam_from_world;
}

MotionPrior CameraMotion::prior(capture::Timestamp at, const Readout& readout) const {
  MotionPrior out;
  out.readout = readout;
  const double length_s = last_at_ ? capture::seconds(at - *last_at_) : 0;
  if (!(length_s > 0 && length_s < longest_interval_s)) {
    out.turn_sigma_rad_s = hand_rad_s, out.shift_sigma_m_s = hand_m_s;
    return out;
  }
  out.before = last_pose_;
  out.per_frame_hz = 1 / length_s;
  if (!last_interval_) {
    out.turn_sigma_rad_s = 0.5 * length_s * hand_rad_s2, out.shift_sigma_m_s = 0.5 * length_s * hand_m_s2;
    return out;
  }
  out.accelerating_s = 0.5 * (length_s + last_interval_->length_s);
  out.kept = 0.5 * length_s / out.accelerating_s;
  out.velocity_before = last_interval_->velocity;
  out.turn_sigma_rad_s = std::hypot(least_rad_s, off_by_share_of_change * std::sqrt(turn_change_));
  out.shift_sigma_m_s = std::hypot(least_m_s, off_by_share_of_change * std::sqrt(shift_change_));
  return out;
}

MotionPrior CameraMotion::prior_from_next(capture::Timestamp at, capture::Timestamp next_at, const calib::Rigid3d& next,
                                          const Readout& readout) {
  CameraMotion backwards;
  backwards.last_at_ = at - (next_at - at), backwards.last_pose_ = next;
  MotionPrior out = backwards.prior(at, readout);
  out.per_frame_hz = -out.per_frame_hz;  // what it sees as the frame before is the one after
  return out;
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
