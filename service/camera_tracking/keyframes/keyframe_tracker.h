// Our camera tracker: CameraMethod::huetrack. Model: ../design.md.
#pragma once

#include <memory>

#include "camera_tracking/camera_tracker.h"

namespace huetrack::keyframes {

// options: valid. Throws std::runtime_error naming the map file if it cannot be loaded or has another image size.
std::unique_ptr<camera_tracking::CameraTracker> make_keyframe_tracker(
    const calib::Camera& camera, const camera_tracking::CameraTrackerOptions& options);

}  // namespace huetrack::keyframes
