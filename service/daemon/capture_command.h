// A camera host: `huetrackd capture CONFIG`.
#pragma once

#include <filesystem>
#include <stop_token>
#include <vector>

#include "capture/live_camera.h"
#include "config/service_config.h"

namespace huetrack::daemon {

// Exports the cameras to trackers, until the stop. Logs camera events and notifies the service manager: ready once all
// cameras were tried; watchdog only while every camera's thread is alive. throws CaptureError as open_cameras();
// std::invalid_argument, std::runtime_error as hosts::CameraHost.
void capture_cameras(const std::filesystem::path& config, const std::stop_token& stop);
// With these cameras.
void capture_cameras(const config::CaptureConfig& config, std::vector<capture::LiveCamera> cameras,
                     const std::stop_token& stop);

}  // namespace huetrack::daemon
