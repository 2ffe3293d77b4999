// Figures of a volume, its accuracy, and the cameras around it.
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

// A value at every point of a grid; NaN: none.
struct VolumeValues {
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();
  solver::WorldBox box;
  std::array<int, 3> steps{};  // along x, y, z; > 0
  std::vector<double> values;  // millimetres; x fastest, then y, then z
  bool are_cells = false;      // values of cells that fill the box; otherwise of points, the outermost on its faces
  double at(int x, int y, int z) const { return values[static_cast<std::size_t>((z * steps[1] + y) * steps[0] + x)]; }
};
VolumeValues values_of(const solver::VolumeAccuracy& map);  // the total

// At most three horizontal slices, the lowest first, with a scale. most_mm: value of the darkest colour; 0: the 95 %
// quantile.
Figure slices_figure(const VolumeValues& values, const std::string& none_means, double most_mm,
                     const std::string& caption);

// Plan: cameras with their fields of view, the volume, and marked places with names.
struct PlaceOnPlan {
  std::string name;  // may be empty: a dot
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
};
Figure plan_figure(const calib::CameraRig& rig, const solver::WorldBox& box, const std::vector<PlaceOnPlan>& marked,
                   const std::string& caption);

}  // namespace huetrack::report
