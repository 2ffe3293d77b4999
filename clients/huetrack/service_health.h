// A service's health for `huetrack status`: JSON and exit status. Pure functions.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "idl/camera_host.h"
#include "idl/camera_times.h"
#include "idl/huetrack.h"

namespace huetrack::client {

// Problems, one sentence each: its warnings, cameras that do not deliver, an old status. now: UNIX ns.
std::vector<std::string> problems_of(const msg::ServiceStatus& status, std::int64_t now);

// One line: {"version":1,"healthy":...,"problems":[...],"status":{...},"times":{...} or
// null,"poses":[...],"clocks":...}; the objects are those of the page's events (live_view/events.h). Keys may be added
// within a version.
//   times, poses, clocks   as for text() of sample_format.h
std::string status_json(const msg::ServiceStatus& status, std::int64_t now, const msg::CameraTimes* times,
                        std::span<const msg::CameraPose> poses, const msg::HostClocks* clocks = nullptr);
// Without a service.
std::string no_status_json(const std::string& why);

}  // namespace huetrack::client
