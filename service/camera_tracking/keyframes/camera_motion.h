// The camera's velocity and acceleration from its last poses, and its readout time: together they give the motion
// within a frame.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "calib/model/camera_rig.h"
#include "calib/model/rigid3.h"
#include "camera_tracking/swept_pose.h"
#include "capture/frames/frame.h"

namespace huetrack::keyframes {

using namespace camera_tracking;

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// From the first row's mid-exposure to the last one's, seconds.
struct Readout {
  double mean_s = 0, sigma_s = 0;
};

// The prior of a frame's motion, conditioned on the pose of its middle row: velocity and acceleration are linear in the
// pose's difference from the expected one. Tangents of cam_from_world, per second.
struct MotionPrior {
  Readout readout;
  calib::Rigid3d expected;  // cam_from_world of the middle row
  calib::Tangent6d expected_velocity = calib::Tangent6d::Zero(), expected_acceleration = calib::Tangent6d::Zero();
  Matrix6d d_velocity_d_pose = Matrix6d::Zero(), d_acceleration_d_pose = Matrix6d::Zero();
  Matrix6d velocity_covariance = Matrix6d::Zero();  // given the pose

  calib::Tangent6d velocity(const calib::Rigid3d& cam_from_world) const;
  calib::Tangent6d bend(const calib::Rigid3d& cam_from_world, double readout_s) const;  // Sweep::bend
  Sweep sweep(const calib::Rigid3d& cam_from_world, double last_row) const;
  MotionPrior without_uncertainty() const;
  // Of a sweep's motion about sweep().motion, the readout's uncertainty included.
  Matrix6d covariance(const calib::Tangent6d& velocity) const;
};

// Four Kalman filters of pose, velocity and acceleration (Singer 1970) with different process noise; the prior comes
// from the one with the largest recent likelihood. A pure function of the poses since the last forget().
// thread-compatible.
class CameraMotion {
 public:
  void forget() { *this = {}; }                                             // the camera was lost, or moved unseen
  void begin(capture::Timestamp at, const calib::Rigid3d& cam_from_world);  // initialises without a velocity
  // covariance: of the pose's tangent. Calls begin() if the last pose is missing or too old.
  void add(capture::Timestamp at, const calib::Rigid3d& cam_from_world, const Matrix6d& covariance);
  MotionPrior prior(capture::Timestamp at, const Readout& readout) const;
  // For the first of two frames, from the second one.
  static MotionPrior prior_from_next(capture::Timestamp at, capture::Timestamp next_at, const calib::Rigid3d& next,
                                     const Readout& readout);

 private:
  using Vector18d = Eigen::Matrix<double, 18, 1>;
  using Matrix18d = Eigen::Matrix<double, 18, 18>;
  struct Filter {
    calib::Rigid3d pose;
    calib::Tangent6d velocity = calib::Tangent6d::Zero(), acceleration = calib::Tangent6d::Zero();
    Matrix18d covariance = Matrix18d::Zero();  // of the three, up to the factor mean_nis
    double mean_nis = 1;                       // fading mean of the normalised innovation squared, per axis
    double log_likelihood = 0;                 // fading sum
  };
  static Filter predicted(const Filter& filter, std::size_t index, double dt_s);
  static void update(Filter& filter, const calib::Rigid3d& cam_from_world, const Matrix6d& covariance);

  std::optional<capture::Timestamp> last_at_;
  std::array<Filter, 4> filters_;  // by increasing process noise
};

// Estimates a camera's readout time from the measurements of single frames. thread-compatible.
class ReadoutLearner {
 public:
  explicit ReadoutLearner(const calib::CameraTiming& timing);
  void add(const Readout& measured);  // by one frame
  Readout readout() const;

 private:
  Readout prior_, averaged_;
};

}  // namespace huetrack::keyframes
