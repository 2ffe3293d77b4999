// Discovers running services by their status samples.
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
  std::string config_file;  // by its status
};

// Listens for `patience`. Uses of the options: domain, interfaces, profiles. throws as EstimatePublisher's constructor.
std::vector<RunningService> running_services(const EstimatePublisherOptions& options,
                                             std::chrono::milliseconds patience);

}  // namespace huetrack::publish
