// Which services there are on the bus: from their status, which each publishes and keeps for who comes late.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "publish/estimate_publisher.h"

namespace huetrack::publish {

struct RunningService {
  std::uint32_t pid = 0;
  bool is_on_this_host = false;
  std::string mode;         // "run" or "replay"
  std::string config_file;  // as it says
};

// Listens for so long. Of the options: domain, interfaces, profiles. throws as EstimatePublisher's constructor does.
std::vector<RunningService> running_services(const EstimatePublisherOptions& options,
                                             std::chrono::milliseconds patience);

}  // namespace huetrack::publish
