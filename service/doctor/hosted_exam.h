// What `huetrackd doctor` finds out about the cameras of other hosts: over the bus, as a tracker would have them.
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
  capture::CameraHealth health;  // with the clock of its host
  double fps = 0;                // of what came, from its first frame on
};

// Takes the frames of all cameras of the configuration that other hosts have, in real time, whatever they are to send
// otherwise: for `duration`, and at least until hosts are known to be silent and their clocks were compared. In the
// order of the configuration; none when there are none. throws what joining the bus throws.
std::vector<HostedExam> examine_hosted(const config::ServiceConfig& config, std::chrono::duration<double> duration,
                                       const std::stop_token& stop);

}  // namespace huetrack::doctor
