#include "camera_tracking/camera_tracker.h"

#include <stdexcept>

#include "camera_tracking/keyframe_tracker.h"
#include "camera_tracking/led_tracker.h"
#include "camera_tracking/lee_tracker.h"
#include "camera_tracking/pupilli_tracker.h"

namespace huetrack {

std::string_view name(CameraState state) {
  switch (state) {
    case CameraState::searching: return "searching";
    case CameraState::tracking: return "tracking";
    case CameraState::coasting: return "coasting";
    case CameraState::lost: return "lost";
  }
  return "";
}

std::string_view name(CameraMethod method) {
  switch (method) {
    case CameraMethod::huetrack: return "huetrack";
    case CameraMethod::pupilli: return "pupilli";
    case CameraMethod::lee: return "lee";
    case CameraMethod::herranz: return "herranz";
  }
  return "";
}

std::unique_ptr<CameraTracker> CameraTracker::make(const Camera& camera, const CameraTrackerOptions& options) {
  std::string all;
  for (const auto& problems : {camera.problems(), options.problems()}) {
    for (const std::string& p : problems) all += (all.empty() ? "" : "; ") + p;
  }
  if (!all.empty()) throw std::invalid_argument("camera tracker: " + all);
  if (std::holds_alternative<LedStart>(options.start)) return make_led_tracker(camera, options);
  switch (options.method) {      // each method's maker is called here as soon as the method is there
    case CameraMethod::huetrack: return make_keyframe_tracker(camera, options);
    case CameraMethod::pupilli: return make_pupilli_tracker(camera, options);
    case CameraMethod::lee: return make_lee_tracker(camera, options);
    case CameraMethod::herranz: break;
  }
  throw std::invalid_argument("camera tracker: the method " + std::string(name(options.method)) + " needs LEDs to start from");
}

}  // namespace huetrack
