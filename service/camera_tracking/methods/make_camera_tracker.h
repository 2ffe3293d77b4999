// The tracker of the method that the options name.
#pragma once

#include <memory>

#include "camera_tracking/camera_tracker.h"

namespace huetrack::camera_methods {

// throws std::invalid_argument, naming the problems.
std::unique_ptr<camera_tracking::CameraTracker> make_camera_tracker(
    const calib::Camera& camera, const camera_tracking::CameraTrackerOptions& options);

}  // namespace huetrack::camera_methods
