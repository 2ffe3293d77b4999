// LED markers in images: the tracker of the methods herranz and, with a LedStart, huetrack.
#pragma once

#include <memory>

#include "camera_tracking/methods/make_camera_tracker.h"

namespace huetrack {

// options: valid, with a LedStart. Throws nothing that make_camera_tracker() has not thrown.
std::unique_ptr<CameraTracker> make_led_tracker(const Camera& camera, const CameraTrackerOptions& options);

}  // namespace huetrack
