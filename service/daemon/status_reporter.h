// Turns the pipeline's figures into the status sample: rates, health of the cameras, warnings.
#pragma once

#include <chrono>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/v4l2_source.h"
#include "pipeline/pipeline.h"
#include "config/service_config.h"
#include "publish/service_status.h"

namespace huetrack {

// thread-compatible.
class StatusReporter {
 public:
  // mode: "replay" or "run"
  StatusReporter(const ServiceConfig& config, std::string mode, Duration clock_offset);

  // Another configuration of the same cameras is in force; rates go on.
  void take_over(const ServiceConfig& config);

  // live: what the live cameras say of themselves, by rig camera, nullopt for one that is not used; empty in a replay.
  // Rates are over the time since a report at least half a second ago.
  ServiceStatus report(const PipelineFigures& figures, std::chrono::steady_clock::time_point now, Timestamp unix_now,
                       std::span<const std::optional<CameraHealth>> live = {});

 private:
  ServiceStatus fixed_;  // what does not change
  std::vector<TargetOptions> targets_;
  std::string tracked_camera_;
  struct Past {
    std::chrono::steady_clock::time_point at;
    PipelineFigures figures;
  };
  std::optional<Past> past_, latest_;
};

}  // namespace huetrack
