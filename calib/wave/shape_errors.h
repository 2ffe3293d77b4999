// Propagates the covariance of camera poses to triangulated positions. Private to this module.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/solver/volume_accuracy.h"
#include "calib/wave/wave_adjustment.h"

namespace huetrack::wave {

// Linear map from errors of poses and lenses (as WaveFit::covariance has them) to errors of positions triangulated from
// exact pixels, after the best rigid alignment of all places: a motion of the whole world is no error.
struct ShapeErrors {
  Eigen::MatrixXd by_errors;  // 3 rows per place
  Eigen::MatrixXd alignment;  // 6 rows: the motion that is removed (translation, rotation about the origin)
  double places = 0;          // seen by two or more cameras
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  // mean of these places
  double reach_m = 0;                                // their rms distance from it

  double rms(const Eigen::MatrixXd& covariance) const;  // metres; covariance: as WaveFit::covariance
  // For the rig file: poses in the world aligned with the places, with a scale of relative uncertainty scale_sigma.
  calib::RigUncertainty uncertainty(const calib::CameraRig& rig, const WaveState& state,
                                    const Eigen::MatrixXd& covariance, double scale_sigma) const;
  // Error of one camera's pose in the aligned world, by all errors: 6 rows.
  Eigen::MatrixXd of_camera(Eigen::Index camera, const Eigen::Vector3d& centre) const;
};

// Lenses from `rig`, which has those found; poses from `state`.
ShapeErrors shape_errors(const calib::CameraRig& rig, const WaveState& state,
                         const std::vector<Eigen::Vector3d>& places);

std::vector<Eigen::Vector3d> places_along(const BallPath& path, double from_s, double to_s);
std::vector<Eigen::Vector3d> places_in(const solver::WorldBox& box);

}  // namespace huetrack::wave
