#include "calib/wave/consistent_regions.h"

#include <gtest/gtest.h>

#include "wave/waving.h"

namespace huetrack::wave {
namespace {

constexpr double radius_m = 0.04, frame_s = 1 / 30.0;

// Share of the frames in which the last region is chosen: the ball, where something larger is in view in all of them.
double found(const calib::CameraRig& rig, const std::vector<BallFrame>& frames, double of_radius_m) {
  const std::vector<int> chosen = consistent_regions(rig, frames, of_radius_m, frame_s);
  int right = 0;
  for (std::size_t f = 0; f < frames.size(); ++f)
    right += chosen[f] >= 0 && chosen[f] + 1 == static_cast<int>(frames[f].regions.size()) ? 1 : 0;
  return right / static_cast<double>(frames.size());
}

std::vector<BallFrame> by_time(std::vector<BallFrame> frames) {
  std::ranges::stable_sort(frames, {}, &BallFrame::t_s);
  return frames;
}

TEST(ConsistentRegions, AreTheBallAlsoWithRoughPoses) {
  const calib::CameraRig truth = rig_of(3);
  const auto frames = by_time(waved(truth, {.wrong = 1}));
  EXPECT_GT(found(truth, frames, radius_m), 0.97);
  EXPECT_GT(found(spoilt(truth, 0.05, 2), frames, radius_m), 0.9);
}

TEST(ConsistentRegions, AreNotThoseOfAnotherSize) {
  const calib::CameraRig truth = rig_of(3);
  EXPECT_LT(found(truth, by_time(waved(truth, {})), 2 * radius_m), 0.01);
  EXPECT_GT(found(truth, by_time(waved(truth, {})), 0.9 * radius_m), 0.97);
}

TEST(ConsistentRegions, NeedTwoCameras) {
  const calib::CameraRig truth = rig_of(2);
  const auto frames = by_time(waved(truth, {.hidden = [](int camera, double) { return camera == 1; }}));
  EXPECT_EQ(found(truth, frames, radius_m), 0);
}

}  // namespace
}  // namespace huetrack::wave
