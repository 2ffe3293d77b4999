// Examines remote cameras for `huetrackd doctor`, as a tracker would receive them.
#pragma once

#include <chrono>
#include <stop_token>
#include <string>
#include <vector>

#include "capture/v4l2_source.h"
#include "config/service_config.h"

namespace huetrack::doctor {

struct HostedExam {
  std::string name, host;
  capture::CameraHealth health;  // with its host's clock
  double fps = 0;                // received, from the first frame on
};

// Receives frames (regardless of `send`) of all remote cameras of the configuration, for `duration`, at least until
// silent hosts are detected and clocks compared. In the order of the configuration. throws as joining DDS.
std::vector<HostedExam> examine_hosted(const config::ServiceConfig& config, std::chrono::duration<double> duration,
                                       const std::stop_token& stop);

}  // namespace huetrack::doctor
