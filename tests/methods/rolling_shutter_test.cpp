// Our tracker on a rendered desk, every row of whose frames is exposed at its own time.
#include <gmock/gmock.h>

#include "benchmark/camera_sequence.h"
#include "camera_tracking/methods/make_camera_tracker.h"
#include "scene/desk_scene.h"

namespace huetrack::camera_tracking {
namespace {

constexpr double readout_s = 0.03;

const figures::CameraSequence& swept_desk() {
  static const figures::CameraSequence sequence = [] {
    const scene::DeskScene desk(5);
    const scene::HandHeld hand({.seed = 5, .length_s = 1.3, .fastest_deg_s = 45, .still_s = 0.1});
    figures::CameraSequence out;
    out.camera = desk.camera;
    out.frames = scene::render(desk, hand, {.frames = 36, .readout_s = readout_s});
    for (const capture::Frame& f : out.frames)
      out.world_from_camera.emplace_back(hand.world_from_camera(capture::seconds(f.captured_at)));
    return out;
  }();
  return sequence;
}

std::vector<CameraEstimate> track(const calib::CameraTiming& timing) {
  calib::Camera camera = swept_desk().camera;
  camera.timing = timing;
  CameraTrackerOptions options;
  options.start = RectangleStart{scene::DeskScene::rectangle_corners(), {}};
  return figures::run(*camera_methods::make_camera_tracker(camera, options), swept_desk());
}

calib::CameraTiming readout(double mean_s) {
  calib::CameraTiming timing;
  timing.readout_s = mean_s, timing.readout_sigma_s = 2e-4;
  return timing;
}

TEST(RollingShutter, KnownReadoutIsAsAccurateAsAGlobalShutter) {
  const figures::PoseErrors known = figures::errors_of(track(readout(readout_s)), swept_desk()),
                            ignored = figures::errors_of(track(readout(0)), swept_desk());
  EXPECT_EQ(known.tracked, 36);
  EXPECT_LT(known.rms_m, 0.0015);
  EXPECT_LT(known.rms_deg, 0.15);
  EXPECT_GT(ignored.rms_m, 4 * known.rms_m);
}

TEST(RollingShutter, UnknownReadoutIsEstimated) {
  const auto estimates = track({});
  const figures::PoseErrors e = figures::errors_of(estimates, swept_desk());
  EXPECT_EQ(e.tracked, 36);
  EXPECT_LT(e.mean_nees, 12);
  EXPECT_EQ(estimates.front().readout_s, 0);
  EXPECT_NEAR(estimates.front().readout_sigma_s, 0.02, 1e-9);
  const CameraEstimate& last = estimates.back();
  EXPECT_NEAR(last.readout_s, readout_s, 3 * last.readout_sigma_s);
  EXPECT_LT(last.readout_sigma_s, 0.012);
}

}  // namespace
}  // namespace huetrack::camera_tracking
