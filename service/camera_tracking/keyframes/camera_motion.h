// What a camera's last poses say about how fast it moves, and its readout time, of which the motion within a frame is
// the product.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "calib/model/camera_rig.h"
#include "calib/model/rigid3.h"
#include "camera_tracking/swept_pose.h"
#include "capture/frames/frame.h"

namespace huetrack::keyframes {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// From the first row's mid-exposure to the last one's, seconds.
struct Readout {
  double mean_s = 0, sigma_s = 0;
};

// A frame's motion as it is known before its own rows are asked, given where its middle row is seen from.
struct MotionPrior {
  Readout readout;
  calib::Rigid3d expected;                                     // cam_from_world
  calib::Tangent6d velocity_there = calib::Tangent6d::Zero(),  // of the middle row, were it seen from there; per second
      acceleration_there = calib::Tangent6d::Zero();
  // By how much they are others for a pose beside the one expected, d / d tangent of it.
  Matrix6d velocity_by_pose = Matrix6d::Zero(), acceleration_by_pose = Matrix6d::Zero();
  Matrix6d velocity_covariance = Matrix6d::Zero();  // of what the pose leaves open

  // When the middle row is exposed.
  calib::Tangent6d velocity(const calib::Rigid3d& cam_from_world) const;
  calib::Tangent6d bend(const calib::Rigid3d& cam_from_world, double readout_s) const;  // Sweep::bend
  camera_tracking::Sweep sweep(const calib::Rigid3d& cam_from_world, double last_row) const;
  MotionPrior held() const;  // as if it were sure
  // Of a sweep's motion about sweep().motion, the readout's included.
  Matrix6d covariance(const calib::Tangent6d& velocity) const;
};

// Kalman filters of pose, velocity and acceleration, each of another restlessness of the hand; the one that the last
// poses make likeliest is believed. thread-compatible. A pure function of the poses added since the last forget().
class CameraMotion {
 public:
  void forget();                                                            // it was lost, or set down elsewhere
  void begin(capture::Timestamp at, const calib::Rigid3d& cam_from_world);  // nothing but this start is known
  // covariance: of the pose's tangent. As begin() when there is none before, or not lately.
  void add(capture::Timestamp at, const calib::Rigid3d& cam_from_world, const Matrix6d& covariance);
  MotionPrior prior(capture::Timestamp at, const Readout& readout) const;
  // Of the first of two frames, by the second one.
  static MotionPrior prior_from_next(capture::Timestamp at, capture::Timestamp next_at, const calib::Rigid3d& next,
                                     const Readout& readout);

 private:
  using Vector18d = Eigen::Matrix<double, 18, 1>;
  using Matrix18d = Eigen::Matrix<double, 18, 18>;
  struct Hand {
    calib::Rigid3d pose;
    calib::Tangent6d velocity = calib::Tangent6d::Zero(), acceleration = calib::Tangent6d::Zero();
    Matrix18d covariance = Matrix18d::Zero();  // of the three
    double surprise = 1;                       // fading mean square of what poses were off, per axis, in sigmas
    double log_likelihood = 0;                 // fading
  };
  static Hand ahead(const Hand& hand, std::size_t which, double length_s);
  static void observe(Hand& hand, const calib::Rigid3d& cam_from_world, const Matrix6d& covariance);

  std::optional<capture::Timestamp> last_at_;
  std::array<Hand, 4> hands_;  // from the calmest one on
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
