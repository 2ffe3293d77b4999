// A camera host: `huetrackd capture CONFIG`.
#pragma once

#include <filesystem>
#include <stop_token>
#include <vector>

#include "capture/live_camera.h"
#include "config/service_config.h"

namespace huetrack::daemon {

// Gives the cameras to the trackers that ask for them, until the stop. What the cameras say goes to the log, and to the
// service manager: ready once all of them were tried; the watchdog is told only while every camera's thread comes
// round. throws CaptureError as open_cameras(); std::invalid_argument, std::runtime_error as hosts::CameraHost.
void capture_cameras(const std::filesystem::path& config, const std::stop_token& stop);
// With these cameras.
void capture_cameras(const config::CaptureConfig& config, std::vector<capture::LiveCamera> cameras,
                     const std::stop_token& stop);

}  // namespace huetrack::daemon
