// What a camera's last poses say about how fast it moves, and its readout time, of which the motion within a frame is
// the product.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "calib/model/camera_rig.h"
#include "calib/model/rigid3.h"
#include "camera_tracking/swept_pose.h"
#include "capture/frame.h"

namespace huetrack::keyframes {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// From the first row's mid-exposure to the last one's, seconds.
struct Readout {
  double mean_s = 0, sigma_s = 0;
};

// A frame's motion as it is known before its own rows are asked, given where its middle row is seen from.
struct MotionPrior {
  Readout readout;
  calib::Rigid3d before;                                        // cam_from_world one frame earlier
  double per_frame_hz = 0;                                      // 0: nothing is known of its motion
  double kept = 0;                                              // of the acceleration until the frame before
  calib::Tangent6d velocity_before = calib::Tangent6d::Zero();  // mean, of the interval before the last one; per second
  double accelerating_s = 1;                                    // between the middles of the two intervals
  double turn_sigma_rad_s = 0, shift_sigma_m_s = 0;             // of the velocity, per axis

  // When the middle row is exposed.
  calib::Tangent6d velocity(const calib::Rigid3d& cam_from_world) const;
  calib::Tangent6d bend(const calib::Rigid3d& cam_from_world, double readout_s) const;  // Sweep::bend
  double velocity_per_tangent_hz() const { return (1 + kept) * per_frame_hz; }  // d velocity / d tangent of the pose
  camera_tracking::Sweep sweep(const calib::Rigid3d& cam_from_world, double last_row) const;
  MotionPrior held() const;  // as if it were sure
  // Of a sweep's motion about sweep().motion, the readout's included.
  Matrix6d covariance(const calib::Tangent6d& velocity) const;
};

// thread-compatible. A pure function of the poses added since the last forget().
class CameraMotion {
 public:
  void forget();  // it was lost, or set down elsewhere
  void add(capture::Timestamp at, const calib::Rigid3d& cam_from_world);
  MotionPrior prior(capture::Timestamp at, const Readout& readout) const;
  // Of the first of two frames, by the second one.
  static MotionPrior prior_from_next(capture::Timestamp at, capture::Timestamp next_at, const calib::Rigid3d& next,
                                     const Readout& readout);

 private:
  struct Interval {
    calib::Tangent6d velocity;  // mean; per second
    double length_s;
  };
  std::optional<capture::Timestamp> last_at_;
  calib::Rigid3d last_pose_;
  std::optional<Interval> last_interval_;
  std::optional<calib::Tangent6d> last_change_;  // of the velocity, from interval to interval
  double turn_change_ = 0, shift_change_ = 0;    // of that change, from one to the next: fading mean squares
};

// Learns a camera's readout time from what single frames say. thread-compatible.
class ReadoutLearner {
 public:
  explicit ReadoutLearner(const calib::CameraTiming& timing);
  void add(const Readout& measured);  // by one frame
  Readout readout() const;

 private:
  Readout told_, averaged_;
};

}  // namespace huetrack::keyframes
