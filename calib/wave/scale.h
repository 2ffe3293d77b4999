// Scale, vertical and world frame of a solution, from all that is known of them. Private to this module.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "calib/wave/flights.h"
#include "calib/wave/wave.h"
#include "calib/wave/wave_solution.h"

namespace huetrack::wave {

// What the ball's free flights say. Errors are true less found, by WaveFit's errors of poses and lenses (3 rows).
struct Throws {
  Gravity gravity;              // in the solution's units and world
  Eigen::Matrix3d by_outlines;  // covariance of its acceleration, without that by poses and lenses
  Eigen::MatrixXd by_errors;    // see above

  Eigen::Vector3d up() const { return -gravity.acceleration.normalized(); }
};
std::optional<Throws> find_throws(const WaveSolution& wave, const WaveOptions& options);

// All sources of the scale, weighed by their covariance.
struct WeighedScale {
  WaveScale scale;
  double factor = 1;             // from the solution to metres
  Eigen::RowVectorXd by_errors;  // of the log of the scale, by WaveFit's errors
  double own_sigma = 0;          // of the log of the scale, without these

  // WaveFit's covariance in metres: the scale's error, as far as it follows from those of poses and lenses, is in it.
  Eigen::MatrixXd of_metres(const Eigen::MatrixXd& covariance, const WaveState& state) const;
};
// covariance: as WaveFit::covariance. throws CalibrationError: a given distance is between places where the ball was
// not
WeighedScale weigh_scale(const WaveSolution& wave, const calib::CameraRig& rig, const WaveOptions& options,
                         const std::optional<Throws>& throws, const Eigen::MatrixXd& covariance);

// World frame: of the marks, of the rig, or of the first camera with z up by the throws, by the floor or in its image;
// its height with WaveOptions::floor. Sets WaveResult::marks_error_m. throws CalibrationError: the marks are collinear,
// or the ball did not rest on the floor
void set_world(WaveResult& result, WaveSolution& wave, const calib::CameraRig& rig, const WaveOptions& options,
               const std::optional<Throws>& throws);

// Of the world's z axis. aligned: rotation of the world that its alignment with the places removes, by WaveFit's
// errors.
WaveVertical vertical_of(const Throws& throws, const Eigen::MatrixXd& aligned, const Eigen::MatrixXd& covariance);

}  // namespace huetrack::wave
