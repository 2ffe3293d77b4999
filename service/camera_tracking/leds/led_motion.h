// The 12-dimensional state of Herranz et al., section III.A, how it moves, and what a LED's pixel tells of it.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "calib/model/camera_model.h"
#include "calib/model/rigid3.h"
#include "camera_tracking/camera_estimate.h"

namespace huetrack::leds {

// [x, v, R, omega] of section III.A, with R stored as a rotation, as there. Departure: the velocities are those along
// and about the camera's own axes, so that a camera that circles what it looks at has constant ones. Beyond the paper,
// for our filter only: the accelerations. A hand or a robot keeps them for some tenths of a second, which is many
// frames.
struct LedMotionState {
  calib::Rigid3d world_from_camera;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();              // camera axes, m/s
  Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();          // camera axes, rad/s
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();          // of velocity, m/s^2
  Eigen::Vector3d angular_acceleration = Eigen::Vector3d::Zero();  // of angular_rate, rad/s^2
};

// Errors of a state: (dt, w, dv, domega, da, dalpha): true translation t + dt, rotation exp(w) R, velocities v + dv,
// ...
inline constexpr int led_dimensions = 18;
using LedTangent = Eigen::Matrix<double, led_dimensions, 1>;
using LedCovariance = Eigen::Matrix<double, led_dimensions, led_dimensions>;
LedMotionState corrected(const LedMotionState& state, const LedTangent& error);
LedTangent difference(const LedMotionState& state, const LedMotionState& from);  // corrected(from, difference) is state

// Accelerations are random with these standard deviations, and forget themselves in about that time (Singer 1970).
struct LedMotionNoise {
  double acceleration = 4;          // > 0; m/s^2
  double angular_acceleration = 8;  // > 0; rad/s^2
  double correlation_s = 0.3;       // > 0
};

// dt_s later (or earlier, when negative), as its velocities and accelerations say.
LedMotionState moved(const LedMotionState& state, double dt_s);

struct LedStartVelocity {     // standard deviations when nothing is known
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
  double dt_s = 0;           // when, from the time of the state that it is compared with
  double sigma_px = 1;       // > 0
};

// The measurement model, eq. (2), with the whole lens in it, at state time + dt_s.
//   jacobian   may be null; d px / d error of `state`
// nullopt: the LED is behind the camera or outside the lens model.
using LedJacobian = Eigen::Matrix<double, 2, led_dimensions>;
std::optional<Eigen::Vector2d> led_pixel(const calib::CameraModel& model, const LedMotionState& state,
                                         const Eigen::Vector3d& led, double dt_s, LedJacobian* jacobian);

// Gauss-Newton: the state that fits the sightings and the prior best, from `start` on, with its covariance. Sightings
// that do not project are left out. nullopt: it does not converge.
struct LedFit {
  LedGaussian posterior;
  double chi2 = 0;  // of the sightings alone: sum of squares of (seen - expected) / sigma
  int used = 0;     // sightings in it
};
std::optional<LedFit> fit_leds(const calib::CameraModel& model, std::span<const Eigen::Vector3d> leds,
                               const LedGaussian& prior, const LedMotionState& start,
                               std::span<const LedSighting> sightings, int iterations);

}  // namespace huetrack::leds
