// A volume and the cameras around it, drawn: where it is good.
#pragma once

#include <Eigen/Core>
#include <array>
#include <limits>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/report/document.h"
#include "calib/solver/volume_accuracy.h"

namespace huetrack::report {

drawing::Color blue(double share);  // from pale (0, and below) to dark (1, and above)

// A figure of every place of a grid; NaN: there is none.
struct VolumeValues {
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();
  solver::WorldBox box;
  std::array<int, 3> steps{};  // along x, y, z; > 0
  std::vector<double> values;  // millimetres; x fastest, then y, then z
  bool are_cells = false;      // that fill the box; otherwise places, the outermost ones on its sides
  double at(int x, int y, int z) const { return values[static_cast<std::size_t>((z * steps[1] + y) * steps[0] + x)]; }
};
VolumeValues values_of(const solver::VolumeAccuracy& map);  // the total

// Slices through it from above, the lowest first, at most three; with a scale. most_mm: from there on all is as dark;
// 0: the 95 % quantile.
Figure slices_figure(const VolumeValues& values, const std::string& none_means, double most_mm,
                     const std::string& caption);

// From above: cameras and what they see, the volume, and places that are marked, each with its name.
struct PlaceOnPlan {
  std::string name;  // may be empty: a dot
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
};
Figure plan_figure(const calib::CameraRig& rig, const solver::WorldBox& box, const std::vector<PlaceOnPlan>& marked,
                   const std::string& caption);

}  // namespace huetrack::report
