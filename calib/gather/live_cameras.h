// Live cameras for a calibration: named by their devices, or in a file as huetrackd's configuration names them.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/v4l2_source.h"

namespace huetrack::gather {

struct LiveSettings {
  std::optional<calib::ImageSize> size;  // nullopt: 640x480 where the camera has it, else the largest up to 1280 wide
  double fps = 0;                        // 0: the driver's choice
};

// Whether inputs are NAME=/dev/..., (all of them), rather than files.
bool are_devices(std::span<const std::string> inputs);

// NAME=/dev/... per camera. throws InputError
std::vector<capture::V4l2SourceOptions> live_cameras(std::span<const std::string> devices,
                                                     const LiveSettings& settings);

// The map `cameras` of a YAML file: device, format, size, fps, controls, latency_offset_s, restore_controls, as in
// configs/huetrackd.yaml; everything else in the file is not looked at, so huetrackd's own configuration does.
// throws ConfigError
std::vector<capture::V4l2SourceOptions> live_cameras_in(const std::filesystem::path& file,
                                                        const LiveSettings& settings);

}  // namespace huetrack::gather
