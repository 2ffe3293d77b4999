#include "camera_tracking/camera_tracker.h"

namespace huetrack::camera_tracking {

std::string_view name(CameraState state) {
  switch (state) {
    case CameraState::searching:
      return "searching";
    case CameraState::tracking:
      return "tracking";
    case CameraState::coasting:
      return "coasting";
    case CameraState::lost:
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
