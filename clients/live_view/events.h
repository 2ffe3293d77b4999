// Converts messages of the bus to JSON for the page, and the page's requests to messages. Pure functions.
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
// received_at: by the bridge, UNIX seconds
std::string to_json(const msg::ServiceStatus& status, double received_at);
std::string to_json(const msg::CameraTimes& times);
std::string to_json(const msg::HostClocks& clocks);
std::string to_json(const msg::Scene& scene);
std::string to_json(const msg::Preview& preview);
std::string to_json(const msg::TeachReply& reply);
std::string to_json(const msg::ControlReply& reply);  // without its bytes

// The bridge's own state, sent once a second.
struct Pulse {
  double now = 0;  // UNIX seconds
  int domain = 0;
  std::string bus;      // the participant's description
  int publishers = 0;   // alive publishers of positions
  std::string trouble;  // empty: none
};
std::string to_json(const Pulse& pulse);

// Throws std::invalid_argument with a message for the client: not JSON, a wrong type, too many points.
msg::TeachRequest teach_request_of(const std::string& json);
// Without host and pid, both are empty: for the shown service. Throws std::invalid_argument with a message for the
// client: too many words, or too long ones.
msg::ControlRequest control_request_of(const std::string& json);

}  // namespace huetrack::live_view
