// Free flights of the ball: gravity is a ruler and a plumb line. Model: design.md. Private to this module.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/wave/ball_path.h"

namespace huetrack::wave {

// One outline, linear in the ball's position p at t_s: value = by_position * p + noise of unit variance.
struct PathMeasurement {
  double t_s = 0;
  Eigen::Matrix<double, 2, 3> by_position = Eigen::Matrix<double, 2, 3>::Zero();
  Eigen::Vector2d value = Eigen::Vector2d::Zero();
};

struct FlightOptions {
  double radius = 0.04;                   // > 0; of the ball; all lengths in units of the path, which may be any
  double expected_g = 9.81;               // > 0; roughly: accelerations of a third to three times as much are tried
  double jerk = 60;                       // > 0; of the waving, see WaveAdjustmentOptions::jerk_m_s3
  double frame_s = 1.0 / 30;              // > 0; so uncertain is the moment at which a flight begins or ends
  double frames_as_one = 1;               // see OutlineCorrelation
  std::optional<double> density_kg_m3{};  // > 0; of the ball; nullopt: learnt, with the prior of balls in general
};

struct Flight {
  double from_s = 0, to_s = 0;
  std::vector<std::size_t> measurements{};  // ascending in time
};

struct Gravity {
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  // in vacuum, of the whole recording
  std::vector<Flight> flights{};
  double air_over_ball = 0;  // ratio of the densities
  double misfit = 1;         // squares of the measurements' residuals per degree of freedom
  // Error of `acceleration` by that of each measurement's value (3 x 2 per measurement), and the covariance that the
  // priors (density, lift) add.
  Eigen::MatrixXd gain{};
  Eigen::Matrix3d by_priors = Eigen::Matrix3d::Zero();
};

// Stretches in which gravity and drag alone explain all measurements, with one acceleration for the whole recording;
// nullopt: there are none. measurements: by time. Deterministic.
std::optional<Gravity> gravity_of(const std::vector<PathMeasurement>& measurements, const BallPath& path,
                                  const FlightOptions& options);

// Normal gravity on the ellipsoid WGS 84 (Somigliana's formula), m/s^2.
double normal_gravity(double latitude_deg);

}  // namespace huetrack::wave
