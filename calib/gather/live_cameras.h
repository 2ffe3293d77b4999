// Live cameras for a calibration, by device or from a huetrackd configuration.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/cropped_source.h"

namespace huetrack::gather {

struct LiveSettings {
  std::optional<calib::ImageSize> size;  // nullopt: 640x480 if available, else the largest up to 1280 wide
  double fps = 0;                        // 0: driver's default
};

// Whether all inputs are NAME=/dev/... .
bool are_devices(std::span<const std::string> inputs);

// NAME=/dev/... per camera; or NAME=/dev/...@u,v,width,height for its part of the device's picture (crop). throws
// InputError
std::vector<capture::CameraRequest> live_cameras(std::span<const std::string> devices, const LiveSettings& settings);

// The map `cameras` of a YAML file: device, format, size, crop, fps, controls, latency_offset_s, restore_controls, as
// in configs/huetrackd.yaml; the rest of the file is ignored. throws files::ConfigError
std::vector<capture::CameraRequest> live_cameras_in(const std::filesystem::path& file, const LiveSettings& settings);

}  // namespace huetrack::gather
