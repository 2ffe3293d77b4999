// The cameras of the configuration, as the service and the calibration take frames from them.
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

// The cameras of the configuration, opened as far as they are there and answer, all at once; until a stop. Those of
// other hosts are waited for later. throws CaptureError: one is there, but cannot do what is asked of it, or is there
// under two names.
std::vector<LiveCamera> open_cameras(const config::ServiceConfig& config, const std::stop_token& stop = {});
// The cameras of a camera host, by their order in the configuration.
std::vector<LiveCamera> open_cameras(const config::CaptureConfig& config, const std::stop_token& stop = {});

// "left and right are one camera: /dev/v4l/by-path/... and /dev/video0 are both /dev/video0"; nullopt: no two are.
std::optional<std::string> one_under_two_names(std::span<const config::LiveCameraConfig> cameras);

// Takes the sources out of the cameras. What is known of the frames is what a camera has agreed to, else what it is
// asked for; a camera that is absent may agree later.
SessionSources sources_of(const config::ServiceConfig& config, std::vector<LiveCamera>& cameras);

}  // namespace huetrack::pipeline
