#include "object_tracking/object_estimate.h"

namespace huetrack::object_tracking {

std::string_view name(TrackState state) {
  switch (state) {
    case TrackState::searching:
      return "searching";
    case TrackState::tracking:
      return "tracking";
    case TrackState::coasting:
      return "coasting";
    case TrackState::lost:
      return "lost";
  }
  return "";
}

std::string object_name(std::string_view target, std::uint32_t object) {
  return object == 0 ? std::string(target) : std::string(target) + "_" + std::to_string(object);
}

}  // namespace huetrack::object_tracking
