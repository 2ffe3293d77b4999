// Files of measured positions. Points, which define a rig's world frame:
//   version: 1
//   points:
//     corner:  {world: [0, 0, 0], pixels: {left: [312.4, 200.1], right: [98.0, 240.7]}}
//     door:    {world: [2.4, 0, 0], position: [0.31, -0.22, 0.97]}   # in the rig's present world, as huetrack
//     publishes it on_tile: {pixels: {left: [100, 300], right: [40, 310]}}        # without world: a point on the floor
// Marked places for a ball, which certify a rig:
//   places:
//     a: [0.30, 0.45, 0.02]
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/certify/length_test.h"
#include "calib/model/camera_rig.h"

namespace huetrack::program {

struct PointOfWorld {
  std::string name;
  Eigen::Vector3d in_rig = Eigen::Vector3d::Zero();  // in the rig's present world, metres
  std::optional<double> rms_px;                      // of its pixels; nullopt: given as a position
  std::optional<Eigen::Vector3d> in_world;           // target; nullopt: on the floor
};

// throws files::ConfigError; solver::CalibrationError: the rays of a point do not intersect
std::vector<PointOfWorld> read_points(const std::filesystem::path& file, const calib::CameraRig& rig);

// At least three. throws files::ConfigError
std::vector<certify::MarkedPlace> read_places(const std::filesystem::path& file);

}  // namespace huetrack::program
