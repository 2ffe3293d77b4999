// Named, calibrated cameras in one world. World: right-handed, metres, z up. Pure values.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "calib/model/camera_model.h"
#include "calib/model/rig_history.h"
#include "calib/model/rig_uncertainty.h"
#include "calib/model/rigid3.h"

namespace huetrack::calib {

struct ImageSize {
  int width = 0;  // pixels
  int height = 0;
  bool operator==(const ImageSize&) const = default;
};

// When a camera's rows are exposed. Mid-exposure of row r of H rows:
//   stamp - latency + (r / (H - 1) - 1/2) readout
// An absent value is unknown. A sigma is a standard deviation and needs its value.
struct CameraTiming {
  std::optional<double> latency_s;        // -1..1; from mid-exposure of the middle row to the driver's time stamp
  std::optional<double> latency_sigma_s;  // 0..1
  std::optional<double> readout_s;        // -1..1; from mid-exposure of the first row to the last; < 0: reads upwards
  std::optional<double> readout_sigma_s;  // 0..1

  bool is_known() const { return latency_s || readout_s; }
  bool operator==(const CameraTiming&) const = default;
  std::vector<std::string> problems() const;  // empty when valid; one sentence per violated constraint
};

inline constexpr const char* camera_name_rule =
    "a camera's name has 1 to 64 letters, digits, '_', '-' or '.', and starts with a letter, a digit or '_'";
bool is_camera_name(std::string_view name);

struct Camera {
  std::string name;  // unique in the rig
  ImageSize image_size;
  CameraModel model;
  Rigid3d cam_from_world;  // p_cam = cam_from_world * p_world
  CameraTiming timing;

  std::optional<RawPixel> project_world(const Eigen::Vector3d& p_world) const {
    return model.project(cam_from_world * p_world);
  }
  Eigen::Vector3d centre() const { return inverse(cam_from_world).translation; }  // in the world, metres
  bool contains(const RawPixel& p) const {                                        // the nearest pixel exists
    return p.px.x() >= -0.5 && p.px.y() >= -0.5 && p.px.x() < image_size.width - 0.5 &&
           p.px.y() < image_size.height - 0.5;
  }
  std::vector<std::string> problems() const;  // empty when valid; one sentence per violated constraint
};

// capacity: all pairs of cameras are visited.
inline constexpr std::size_t max_cameras = 256;

struct CameraRig {
  std::vector<Camera> cameras;  // Frame::camera indexes this
  // How the calibration was made, for people (tool, date, residuals): unique keys, nothing empty.
  std::vector<std::pair<std::string, std::string>> made_by{};
  RigHistory made{};                            // date, temperature and later checks
  std::optional<RigUncertainty> uncertainty{};  // nullopt: unknown, treated as exact

  std::optional<int> index_of(std::string_view name) const;
  std::vector<std::string> camera_names() const;  // in rig order
  std::vector<std::string> problems() const;      // empty when valid; one sentence per violated constraint
};

}  // namespace huetrack::calib
