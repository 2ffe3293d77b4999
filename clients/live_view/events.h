// The messages on the bus as JSON for the page, and the page's requests as messages. Pure functions.
//
// Times are UNIX seconds; NaN is null. The page's half of this contract is page/src/messages.ts.
#pragma once

#include <stdexcept>
#include <string>

#include "idl/camera_host.h"
#include "idl/camera_times.h"
#include "idl/huetrack.h"
#include "idl/huetrack_view.h"

namespace huetrack::live_view {

std::string to_json(const msg::ObjectPosition& sample);
std::string to_json(const msg::CameraPose& sample);
std::string to_json(const msg::CameraMap& map);
// heard: when the bridge had it, UNIX seconds
std::string to_json(const msg::ServiceStatus& status, double heard);
std::string to_json(const msg::CameraTimes& times);
std::string to_json(const msg::HostClocks& clocks);
std::string to_json(const msg::Scene& scene);
std::string to_json(const msg::Preview& preview);
std::string to_json(const msg::TeachReply& reply);
std::string to_json(const msg::ControlReply& reply);  // but its bytes, which no page asks for

// What the bridge says about itself, once a second: the pages' pulse.
struct Pulse {
  double now = 0;  // UNIX seconds
  int domain = 0;
  std::string bus;      // where it listens
  int publishers = 0;   // of positions, alive
  std::string trouble;  // empty when all is well
};
std::string to_json(const Pulse& pulse);

// throws std::invalid_argument with a sentence for who wrote the request: not JSON, a wrong type, too many points.
msg::TeachRequest teach_request_of(const std::string& json);
// throws std::invalid_argument with a sentence for who wrote the request: too many words, or too long ones.
msg::ControlRequest control_request_of(const std::string& json);

}  // namespace huetrack::live_view
