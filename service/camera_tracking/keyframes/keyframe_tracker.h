// Our camera tracker: CameraMethod::huetrack. How it works: ../README.md.
#pragma once

#include <memory>

#include "camera_tracking/camera_tracker.h"

namespace huetrack::keyframes {

// options: checked. throws std::runtime_error naming the map file when it cannot be loaded or is of another image size.
std::unique_ptr<camera_tracking::CameraTracker> make_keyframe_tracker(
    const calib::Camera& camera, const camera_tracking::CameraTrackerOptions& options);

}  // namespace huetrack::keyframes
