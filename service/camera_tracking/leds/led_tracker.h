// The tracker of the methods herranz and, with a LedStart, huetrack: detects LEDs in images.
#pragma once

#include <memory>

#include "camera_tracking/camera_tracker.h"

namespace huetrack::leds {

// options: valid, with a LedStart.
std::unique_ptr<camera_tracking::CameraTracker> make_led_tracker(const calib::Camera& camera,
                                                                 const camera_tracking::CameraTrackerOptions& options);

}  // namespace huetrack::leds
