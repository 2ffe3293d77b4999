// Names of states, for people and programs; "unknown" for numbers of later versions.
#pragma once

#include <iterator>
#include <string_view>

#include "idl/camera_host.h"
#include "idl/huetrack.h"

namespace huetrack::idl {

// Of TrackState and CameraState, which are equal.
inline std::string_view state_name(std::uint32_t state) {
  static constexpr std::string_view names[] = {"searching", "tracking", "coasting", "lost"};
  static_assert(msg::TRACK_STATE_LOST == 3 && msg::CAMERA_STATE_LOST == 3);
  return state < std::size(names) ? names[state] : "unknown";
}

inline std::string_view name(msg::CameraHealth health) {
  static constexpr std::string_view names[] = {"waiting", "delivering", "stalled", "absent", "ended"};
  static_assert(msg::CAMERA_HEALTH_ENDED == 4);
  return health < std::size(names) ? names[health] : "unknown";
}

inline std::string_view name(msg::HostedCameraState state) {
  static constexpr std::string_view names[] = {"waiting", "delivering", "stalled", "absent"};
  static_assert(msg::HOSTED_CAMERA_ABSENT == 3);
  return state < std::size(names) ? names[state] : "unknown";
}

}  // namespace huetrack::idl
