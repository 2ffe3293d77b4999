// Tracks a recording through the service's own pipeline, so that the measured positions are those that it would
// publish.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "config/service_config.h"
#include "object_tracking/object_estimate.h"

namespace huetrack::program {

using Estimates = std::vector<object_tracking::ObjectEstimate>;

// Results by published name: a target, or one of its objects.
struct Tracked {
  std::map<std::string, Estimates> estimates;
  std::map<std::string, std::set<std::uint64_t>> further;  // of a target: frame sets with more objects than its count
  std::vector<std::string> named;        // mistakes that the service reports (moved cameras, ...); one sentence each
  std::size_t sets = 0, incomplete = 0;  // 0: unknown
  std::optional<double> set_ms;
};

// Needs a rig. throws InputError: stopped; and the exceptions of reading and tracking a recording
Tracked tracked(const config::ServiceConfig& config, const std::string& file, const std::stop_token& stop);

}  // namespace huetrack::program
