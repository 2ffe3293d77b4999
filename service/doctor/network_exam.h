// What a camera of the network gives, asked as `run` would ask it.
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
  std::string failure;  // why it gives none; empty: it does

  double fps() const { return seconds > 0 ? double(pictures - 1) / seconds : 0; }
};

// Waits as long for the first picture as options.patience says, and then takes pictures for so many seconds.
NetworkTrial try_network_camera(const capture::NetworkSourceOptions& options, std::chrono::duration<double> seconds,
                                const std::stop_token& stop);

Finding judge_network_camera(const NetworkTrial& trial);

}  // namespace huetrack::doctor
