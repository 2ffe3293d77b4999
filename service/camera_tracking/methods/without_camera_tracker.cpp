// Replaces make_camera_tracker.cpp in builds without the methods (HUETRACK_CAMERA_TRACKER=OFF).
#include <stdexcept>

#include "camera_tracking/methods/make_camera_tracker.h"

namespace huetrack::camera_methods {

std::unique_ptr<camera_tracking::CameraTracker> make_camera_tracker(const calib::Camera&,
                                                                    const camera_tracking::CameraTrackerOptions&) {
  throw std::invalid_argument(
      "camera tracker: this program was built without it (HUETRACK_CAMERA_TRACKER=OFF, as the demo is); "
      "cmake --preset release && cmake --build build/release builds all of huetrack");
}

}  // namespace huetrack::camera_methods
