// Files of what somebody measured. Points, from which a rig gets its world:
//   version: 1
//   points:
//     corner:  {world: [0, 0, 0], pixels: {left: [312.4, 200.1], right: [98.0, 240.7]}}
//     door:    {world: [2.4, 0, 0], position: [0.31, -0.22, 0.97]}   # in the rig's present world, as huetrack reports
//     it on_tile: {pixels: {left: [100, 300], right: [40, 310]}}        # without world: a point on the floor
// Marked places on which a ball was put, by which the rig is certified:
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
  std::optional<double> rms_px;                      // of its pixels; nullopt: a position was given
  std::optional<Eigen::Vector3d> in_world;           // where it shall be; nullopt: on the floor
};

// throws ConfigError; CalibrationError: the pixels of a point do not meet
std::vector<PointOfWorld> read_points(const std::filesystem::path& file, const calib::CameraRig& rig);

// Three at least. throws ConfigError
std::vector<certify::MarkedPlace> read_places(const std::filesystem::path& file);

}  // namespace huetrack::program
