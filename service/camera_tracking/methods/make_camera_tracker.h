// Creates the tracker of the configured method.
#pragma once

#include <memory>

#include "camera_tracking/camera_tracker.h"

namespace huetrack::camera_methods {

// Throws std::invalid_argument with all problems of the camera and the options.
std::unique_ptr<camera_tracking::CameraTracker> make_camera_tracker(
    const calib::Camera& camera, const camera_tracking::CameraTrackerOptions& options);

}  // namespace huetrack::camera_methods
