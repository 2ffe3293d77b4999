// Computes the status sample from the pipeline's figures: rates, health of the cameras, warnings.
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

  // Applies another configuration of the same cameras; rates continue.
  void take_over(const config::ServiceConfig& config);

  // live: health of the live cameras, per camera of the rig, nullopt: not used; empty in a replay. Rates are averaged
  // since a report at least half a second ago. do_views_contradict: MistakeReport's.
  publish::ServiceStatus report(const pipeline::PipelineFigures& figures, std::chrono::steady_clock::time_point now,
                                capture::Timestamp unix_now,
                                std::span<const std::optional<capture::CameraHealth>> live = {},
                                bool do_views_contradict = false);

 private:
  calib::RigHistory rig_history_;
  publish::ServiceStatus fixed_;  // constant fields
  std::vector<object_tracking::TargetOptions> targets_;
  std::string tracked_camera_;
  struct Past {
    std::chrono::steady_clock::time_point at;
    pipeline::PipelineFigures figures;
  };
  std::optional<Past> past_, latest_;
};

}  // namespace huetrack::daemon
