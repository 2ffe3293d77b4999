// The cameras of the configuration, as the service and the calibration take frames from them.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "capture/frame_source.h"
#include "capture/v4l2_source.h"
#include "config/service_config.h"
#include "pipeline/session.h"

namespace huetrack::pipeline {

// What the service needs of a live camera: a V4l2Source, or what a test puts in its place.
struct LiveCamera {
  int camera = 0;  // in the rig
  std::unique_ptr<capture::FrameSource> source;
  std::function<capture::CameraHealth()> health;                   // thread-safe while source lives
  std::function<std::vector<capture::CameraEvent>()> take_events;  // likewise
};

// The cameras of the configuration, opened as far as they are there and answer, all at once; until a stop.
// throws CaptureError: one is there, but cannot do what is asked of it, or is there under two names.
std::vector<LiveCamera> open_cameras(const config::ServiceConfig& config, const std::stop_token& stop = {});

// "left and right are one camera: /dev/v4l/by-path/... and /dev/video0 are both /dev/video0"; nullopt: no two are.
std::optional<std::string> one_under_two_names(std::span<const config::LiveCameraConfig> cameras);

// Takes the sources out of the cameras. What is known of the frames is what a camera has agreed to, else what it is
// asked for; a camera that is absent may agree later.
SessionSources sources_of(const config::ServiceConfig& config, std::vector<LiveCamera>& cameras);

}  // namespace huetrack::pipeline
