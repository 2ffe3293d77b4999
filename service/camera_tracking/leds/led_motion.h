// State, motion model and measurement model of Herranz et al., section III.A, and a Gauss-Newton fit.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "calib/model/camera_model.h"
#include "calib/model/rigid3.h"
#include "camera_tracking/camera_estimate.h"

namespace huetrack::leds {

// [x, v, R, omega] of section III.A, plus the accelerations, which only our filter uses. Unlike in the paper,
// velocities are along and about the camera's axes: constant for a camera that circles its target.
struct LedMotionState {
  calib::Rigid3d world_from_camera;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();              // camera axes, m/s
  Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();          // camera axes, rad/s
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();          // of velocity, m/s^2
  Eigen::Vector3d angular_acceleration = Eigen::Vector3d::Zero();  // of angular_rate, rad/s^2
};

// Errors of a state, (dt, w, dv, domega, da, dalpha): true translation t + dt, rotation exp(w) R, velocity v + dv, ...
inline constexpr int led_dimensions = 18;
using LedTangent = Eigen::Matrix<double, led_dimensions, 1>;
using LedCovariance = Eigen::Matrix<double, led_dimensions, led_dimensions>;
LedMotionState corrected(const LedMotionState& state, const LedTangent& error);
LedTangent difference(const LedMotionState& state, const LedMotionState& from);  // corrected(from, difference) is state

// Accelerations as a Gauss-Markov process (Singer 1970): standard deviations and correlation time.
struct LedMotionNoise {
  double acceleration = 4;          // > 0; m/s^2
  double angular_acceleration = 8;  // > 0; rad/s^2
  double correlation_s = 0.3;       // > 0
};

// The state after dt_s (may be negative) with constant accelerations.
LedMotionState moved(const LedMotionState& state, double dt_s);

struct LedStartVelocity {     // standard deviations without a measurement
  double velocity = 1.5;      // > 0; m/s
  double angular_rate = 1.5;  // > 0; rad/s
};

struct LedGaussian {
  LedMotionState mean;
  LedCovariance covariance = LedCovariance::Identity();
};
LedGaussian predicted(const LedGaussian& state, double dt_s, const LedMotionNoise& noise);

// One LED seen in one frame.
struct LedSighting {
  int led = 0;
  Eigen::Vector2d px{0, 0};  // raw pixels
  double dt_s = 0;           // relative to the state's time
  double sigma_px = 1;       // > 0
};

// The measurement model, eq. (2), with the lens model, at the state's time + dt_s.
//   jacobian   d px / d error of `state`; may be null
// nullopt: behind the camera or outside the lens model.
using LedJacobian = Eigen::Matrix<double, 2, led_dimensions>;
std::optional<Eigen::Vector2d> led_pixel(const calib::CameraModel& model, const LedMotionState& state,
                                         const Eigen::Vector3d& led, double dt_s, LedJacobian* jacobian);

// Maximum a posteriori state by Levenberg-Marquardt from `start`, with its covariance. Ignores sightings of LEDs that
// do not project. nullopt: no convergence.
struct LedFit {
  LedGaussian posterior;
  double chi2 = 0;  // of the sightings, without the prior
  int used = 0;     // sightings
};
std::optional<LedFit> fit_leds(const calib::CameraModel& model, std::span<const Eigen::Vector3d> leds,
                               const LedGaussian& prior, const LedMotionState& start,
                               std::span<const LedSighting> sightings, int iterations);

}  // namespace huetrack::leds
