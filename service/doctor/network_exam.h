// Examines a network camera for `huetrackd doctor`, as `run` would open it.
#pragma once

#include <chrono>
#include <cstdint>
#include <stop_token>
#include <string>

#include "capture/network_source.h"
#include "doctor/doctor.h"

namespace huetrack::doctor {

struct NetworkTrial {
  std::uint64_t pictures = 0;
  double seconds = 0;   // from the first picture to the last
  std::string failure;  // why there are none; empty: it works

  double fps() const { return seconds > 0 ? double(pictures - 1) / seconds : 0; }
};

// Waits up to options.patience for the first picture, then takes pictures for `seconds`.
NetworkTrial try_network_camera(const capture::NetworkSourceOptions& options, std::chrono::duration<double> seconds,
                                const std::stop_token& stop);

Finding judge_network_camera(const NetworkTrial& trial);

}  // namespace huetrack::doctor
