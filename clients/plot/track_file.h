// Reads the CSV files of `huetrackd replay --tracks` and `huetrack log` (of targets or of a tracked camera). Pure.
#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "truth/truth.h"

namespace huetrack::plot {

struct TrackRow {
  truth::Timestamp at;
  Eigen::Vector3d position;    // metres; NaN: none
  Eigen::Matrix3d covariance;  // of the position, m^2; NaN: none
  std::string state;           // searching, tracking, coasting, lost
  // Of a camera's log, else NaN: its orientation, x y z w, and the upper triangle of the covariance of position (m) and
  // rotation (rad), row by row.
  Eigen::Vector4d orientation = Eigen::Vector4d::Constant(std::numeric_limits<double>::quiet_NaN());
  std::array<double, 21> pose_covariance{};
  bool is_camera = false;
  bool has_position() const { return position[0] == position[0]; }
};

// By target (or camera), in order of time. Throws ConfigError "file:line: problem".
std::map<std::string, std::vector<TrackRow>> read_tracks(const std::filesystem::path& file);

}  // namespace huetrack::plot
