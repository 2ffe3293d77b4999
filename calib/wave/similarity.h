// Another frame and scale for all poses and the path. Private to this module.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/wave/wave_adjustment.h"

namespace huetrack::wave {

// world_new = scale * rotation * world_old + translation
struct Similarity {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& p) const { return scale * (rotation * p) + translation; }
  void apply(WaveState& state) const;
};

// The frame and scale of the rig that it started from; `scale_too`: nothing else sets it. Cameras that moved count
// little where most did not.
Similarity onto_rig(const calib::CameraRig& rig, const WaveState& state, bool scale_too);

// Points to points, at least three that are not in a line; the scale stays 1.
Similarity onto_points(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to);

}  // namespace huetrack::wave
