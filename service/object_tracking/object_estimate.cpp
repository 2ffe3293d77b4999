#include "object_tracking/object_estimate.h"

#include <iterator>

namespace huetrack::object_tracking {

std::string_view name(TrackState state) {
  static constexpr std::string_view names[] = {"searching", "tracking", "coasting", "lost"};
  static_assert(std::size(names) == std::size_t(TrackState::lost) + 1);
  return names[std::size_t(state)];
}

bool OutlineFindings::contradict(double radius_m) const {
  const double spread = largest_radius_m / least_radius_m;
  return largest_radius_m * spread * ratio < radius_m || least_radius_m > spread * ratio * radius_m;
}

std::string object_name(std::string_view target, std::uint32_t object) {
  return object == 0 ? std::string(target) : std::string(target) + "_" + std::to_string(object);
}

}  // namespace huetrack::object_tracking
