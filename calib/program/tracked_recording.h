// A recording, tracked as the service tracks it: by its own road and trackers, so that what is measured is what will be
// published.
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

// What came of the recording, by what is told: a target, or an object of one.
struct Tracked {
  std::map<std::string, Estimates> estimates;
  std::map<std::string, std::set<std::uint64_t>> further;  // of a target: sets with one object more than its count
  std::vector<std::string> named;  // what the service would have named: moved cameras, mistakes; one sentence each
  std::size_t sets = 0, incomplete = 0;  // 0: not known
  std::optional<double> set_ms;
};

// Requires a rig. throws InputError: it was stopped; and what reading and tracking a recording throw
Tracked tracked(const config::ServiceConfig& config, const std::string& file, const std::stop_token& stop);

}  // namespace huetrack::program
