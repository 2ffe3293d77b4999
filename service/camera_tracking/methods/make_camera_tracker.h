// The tracker of the method that the options name.
#pragma once

#include <memory>

#include "camera_tracking/camera_tracker.h"

namespace huetrack {

// throws std::invalid_argument, naming the problems.
std::unique_ptr<CameraTracker> make_camera_tracker(const Camera& camera, const CameraTrackerOptions& options);

}  // namespace huetrack
