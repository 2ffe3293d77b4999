#include "camera_tracking/camera_tracker.h"

#include <iterator>

namespace huetrack::camera_tracking {

std::string_view name(PoseState state) {
  static constexpr std::string_view names[] = {"searching", "tracking", "coasting", "lost"};
  static_assert(std::size(names) == std::size_t(PoseState::lost) + 1);
  return names[std::size_t(state)];
}

std::string_view name(CameraMethod method) {
  static constexpr std::string_view names[] = {"huetrack", "pupilli", "lee", "herranz"};
  static_assert(std::size(names) == std::size_t(CameraMethod::herranz) + 1);
  return names[std::size_t(method)];
}

}  // namespace huetrack::camera_tracking
