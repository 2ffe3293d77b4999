#include "camera_tracking/methods/make_camera_tracker.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace huetrack::camera_methods {
namespace {

TEST(MakeCameraTracker, ThrowsForInvalidOptions) {
  camera_tracking::CameraTrackerOptions options;
  options.start = camera_tracking::FoundStart{};
  EXPECT_THROW(
      make_camera_tracker(
          calib::Camera{.name = "cam", .image_size = {320, 240}, .model = {}, .cam_from_world = {}, .timing = {}},
          options),
      std::invalid_argument);
}

}  // namespace
}  // namespace huetrack::camera_methods
