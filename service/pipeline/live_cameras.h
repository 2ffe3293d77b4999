// Opens the cameras of a configuration, for the service and for huetrack-calibrate.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "capture/live_camera.h"
#include "config/service_config.h"
#include "pipeline/session.h"

namespace huetrack::pipeline {

using capture::LiveCamera;

// Opens all cameras in parallel. Cameras that are absent or do not answer, and remote cameras, may start to deliver
// later. throws CaptureError if a camera cannot do what the configuration asks, or is listed under two names.
std::vector<LiveCamera> open_cameras(const config::ServiceConfig& config, const std::stop_token& stop = {});
// The cameras of a camera host, in the order of the configuration.
std::vector<LiveCamera> open_cameras(const config::CaptureConfig& config, const std::stop_token& stop = {});

// "left and right are one camera: /dev/v4l/by-path/... and /dev/video0 are both /dev/video0"; nullopt: all differ.
std::optional<std::string> one_under_two_names(std::span<const config::LiveCameraConfig> cameras);

// Moves the sources out of the cameras. Frame period and pixel format are those that a camera has accepted, or else
// those that the configuration requests.
SessionSources sources_of(const config::ServiceConfig& config, std::vector<LiveCamera>& cameras);

}  // namespace huetrack::pipeline
