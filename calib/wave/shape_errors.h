// How well positions are known, from how well the cameras' poses are. Private to this module.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/solver/volume_accuracy.h"
#include "calib/wave/wave_adjustment.h"

namespace huetrack::wave {

// What errors of the camera poses (centre, rotation; world axes) do to positions, triangulated by all cameras that see
// them for exact pixels; but for a motion of the whole world, which is taken away as well as it can be.
struct ShapeErrors {
  Eigen::MatrixXd by_poses;   // three rows per place
  Eigen::MatrixXd alignment;  // the motion that is taken away (translation, rotation about the origin): six rows
  double places = 0;          // that two or more cameras see
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  // the mean of these places
  double reach_m = 0;                                // their rms distance from it

  double rms(const Eigen::MatrixXd& covariance) const;  // metres; covariance: as WaveFit::covariance
  // For the rig file, where the scale is so well known (relative): the cameras' poses in the world that is aligned with
  // the places. The lenses were given, and count as exact.
  calib::RigUncertainty uncertainty(const WaveState& state, const Eigen::MatrixXd& covariance,
                                    double scale_sigma) const;
  // Of a camera's pose, in the world that is aligned with the places: six rows, by all poses.
  Eigen::MatrixXd of_camera(Eigen::Index camera, const Eigen::Vector3d& centre) const;
};

// rig: the lenses; state: the poses.
ShapeErrors shape_errors(const calib::CameraRig& rig, const WaveState& state,
                         const std::vector<Eigen::Vector3d>& places);

std::vector<Eigen::Vector3d> places_along(const BallPath& path, double from_s, double to_s);
std::vector<Eigen::Vector3d> places_in(const solver::WorldBox& box);

}  // namespace huetrack::wave
