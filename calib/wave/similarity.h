// Change of world frame and scale of a solution. Private to this module.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/wave/wave_adjustment.h"

namespace huetrack::wave {

// p_new = scale * rotation * p_old + translation
struct Similarity {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& p) const { return scale * (rotation * p) + translation; }
  void apply(WaveState& state) const;  // to poses and path; changes no pixel
};

// Aligns camera poses with those of `rig`, robustly (iterated L1): a moved camera hardly counts. with_scale: otherwise
// the scale stays 1.
Similarity onto_rig(const calib::CameraRig& rig, const WaveState& state, bool with_scale);

// Refines a rigid alignment: the ball, on the solution's path, lies where the cameras of `rig` saw it. So positions in
// a rig that was right stay what they were, also where light from one side turns the new cameras. Robust: a camera that
// was moved, and sees it elsewhere, hardly counts.
Similarity onto_views(const calib::CameraRig& rig, const WaveState& state, const std::vector<BallObservation>& seen,
                      double radius_m, Similarity start);

// Rigid alignment of points, least squares (Umeyama 1991). >= 3 points, not collinear.
Similarity onto_points(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to);

}  // namespace huetrack::wave
