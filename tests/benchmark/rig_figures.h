// How right a rig's poses are, against the true ones.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/model/camera_rig.h"

namespace huetrack::figures {

// After rigid alignment.
struct RigFigures {
  double volume_m = 0;  // rms, of 2x2x2 m from -1 m, 0.1 m above the floor
  double path_m = 0;    // rms of the places where the ball was, aligned by themselves
  double centre_m = 0;  // worst camera
  double turned_deg = 0;
  double scale = 1;  // of the found volume over the true one
};

// path: where the ball was; may be empty.
RigFigures compare(const calib::CameraRig& truth, const calib::CameraRig& found,
                   const std::vector<Eigen::Vector3d>& path);

}  // namespace huetrack::figures
