#include "camera_tracking/methods/make_camera_tracker.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

#include "calib/files/joined.h"
#include "camera_tracking/keyframes/keyframe_tracker.h"
#include "camera_tracking/leds/led_tracker.h"
#include "camera_tracking/papers/lee_tracker.h"
#include "camera_tracking/papers/pupilli_tracker.h"

namespace huetrack::camera_methods {

using namespace camera_tracking;

std::unique_ptr<CameraTracker> make_camera_tracker(const calib::Camera& camera, const CameraTrackerOptions& options) {
  std::vector<std::string> problems = camera.problems();
  std::ranges::move(options.problems(), std::back_inserter(problems));
  if (!problems.empty()) throw std::invalid_argument("camera tracker: " + files::joined(problems, "; "));
  if (std::holds_alternative<LedStart>(options.start)) return leds::make_led_tracker(camera, options);
  switch (options.method) {
    case CameraMethod::huetrack:
      return keyframes::make_keyframe_tracker(camera, options);
    case CameraMethod::pupilli:
      return papers::make_pupilli_tracker(camera, options);
    case CameraMethod::lee:
      return papers::make_lee_tracker(camera, options);
    case CameraMethod::herranz:
      break;
  }
  throw std::invalid_argument("camera tracker: the method " + std::string(name(options.method)) +
                              " needs LEDs to start from");
}

}  // namespace huetrack::camera_methods
