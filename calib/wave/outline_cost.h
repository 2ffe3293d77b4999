// Residual of one outline, for Ceres, with analytic derivatives. Private to this module.
#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "calib/wave/flights.h"
#include "calib/wave/wave_adjustment.h"

namespace huetrack::wave {

// exp(omega), omega in radians.
Eigen::Matrix3d rotation_of(const Eigen::Vector3d& omega);

// J with exp(omega + d) = exp(omega) exp(J d) to first order.
Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& omega);

// Whitened residual (2), predicted minus measured. Blocks: pose (omega, t: 6), four control points (3 each), latency,
// readout, LensChange. The pose is R = base exp(omega), t: omega stays near 0, far from the singularity of rotation
// vectors.
//   below_middle  -1/2..1/2, see below_middle()
//   path          only its knots are used; must outlive the cost
//   first         the first of the four control points
std::unique_ptr<ceres::CostFunction> outline_cost(const calib::Camera& camera, const Eigen::Matrix3d& base,
                                                  const BallObservation& observation, double below_middle,
                                                  const BallPath& path, std::size_t first, double radius_m);

// An outline, linear around its place on the path, in units of its noise (as the residuals show it).
struct LinearOutline {
  BallObservation observation;
  PathMeasurement in_path;
  Eigen::Matrix<double, 2, 6 + lens_freedom> by_errors;  // of its camera, as WaveFit::covariance has them
};
// By time of exposure; those that project nowhere are left out.
std::vector<LinearOutline> linear_outlines(const calib::CameraRig& rig,
                                           const std::vector<BallObservation>& observations, const WaveState& state,
                                           double radius_m);

}  // namespace huetrack::wave
