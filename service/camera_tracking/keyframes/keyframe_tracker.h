// Our camera tracker: CameraMethod::huetrack. See README.md.
#pragma once

#include <memory>

#include "camera_tracking/camera_tracker.h"

namespace huetrack {

// options: checked. throws std::runtime_error naming the map file when it cannot be loaded or is of another image size.
std::unique_ptr<CameraTracker> make_keyframe_tracker(const Camera& camera, const CameraTrackerOptions& options);

}  // namespace huetrack
