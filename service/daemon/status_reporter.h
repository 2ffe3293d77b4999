// Turns the pipeline's figures into the status sample: rates, health of the cameras, warnings.
#pragma once

#include <chrono>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/model/rig_history.h"
#include "capture/v4l2_source.h"
#include "config/service_config.h"
#include "pipeline/figures.h"
#include "publish/service_status.h"

namespace huetrack::daemon {

// thread-compatible.
class StatusReporter {
 public:
  // mode: "replay" or "run"
  StatusReporter(const config::ServiceConfig& config, std::string mode, capture::Duration clock_offset);

  // Another configuration of the same cameras is in force; rates go on.
  void take_over(const config::ServiceConfig& config);

  // live: what the live cameras say of themselves, by rig camera, nullopt for one that is not used; empty in a replay.
  // Rates are over the time since a report at least half a second ago.
  publish::ServiceStatus report(const pipeline::PipelineFigures& figures, std::chrono::steady_clock::time_point now,
                                capture::Timestamp unix_now,
                                std::span<const std::optional<capture::CameraHealth>> live = {});

 private:
  calib::RigHistory rig_history_;
  publish::ServiceStatus fixed_;  // what does not change
  std::vector<object_tracking::TargetOptions> targets_;
  std::string tracked_camera_;
  struct Past {
    std::chrono::steady_clock::time_point at;
    pipeline::PipelineFigures figures;
  };
  std::optional<Past> past_, latest_;
};

}  // namespace huetrack::daemon
