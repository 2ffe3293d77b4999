#include "camera_tracking/camera_tracker.h"

namespace huetrack::camera_tracking {

std::string_view name(PoseState state) {
  switch (state) {
    case PoseState::searching:
      return "searching";
    case PoseState::tracking:
      return "tracking";
    case PoseState::coasting:
      return "coasting";
    case PoseState::lost:
      return "lost";
  }
  return "";
}

std::string_view name(CameraMethod method) {
  switch (method) {
    case CameraMethod::huetrack:
      return "huetrack";
    case CameraMethod::pupilli:
      return "pupilli";
    case CameraMethod::lee:
      return "lee";
    case CameraMethod::herranz:
      return "herranz";
  }
  return "";
}

}  // namespace huetrack::camera_tracking
