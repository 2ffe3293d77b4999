#include "calib/wave/consistent_regions.h"

#include <gtest/gtest.h>

#include "wave/waving.h"

namespace huetrack::wave {
namespace {

// Share of the frames in which the last region is chosen: the ball, where something larger is in view in all of them.
double share_found(const calib::CameraRig& rig, const std::vector<BallFrame>& frames, double of_radius_m) {
  const std::vector<int> chosen = consistent_regions(rig, frames, of_radius_m, 1 / 30.0);
  int right = 0;
  for (std::size_t f = 0; f < frames.size(); ++f)
    right += chosen[f] >= 0 && chosen[f] + 1 == static_cast<int>(frames[f].regions.size()) ? 1 : 0;
  return right / static_cast<double>(frames.size());
}

std::vector<BallFrame> in_order(std::vector<BallFrame> frames) {
  std::ranges::stable_sort(frames, {}, &BallFrame::t_s);
  return frames;
}

TEST(ConsistentRegions, AreTheBallAlsoWithRoughPoses) {
  const calib::CameraRig truth = rig_of(3);
  const auto frames = in_order(waved(truth, {.wrong = 1}));
  EXPECT_GT(share_found(truth, frames, 0.04), 0.97);
  EXPECT_GT(share_found(spoilt(truth, 0.05, 2), frames, 0.04), 0.9);
}

TEST(ConsistentRegions, AreNotThoseOfAnotherSize) {
  const calib::CameraRig truth = rig_of(3);
  EXPECT_LT(share_found(truth, in_order(waved(truth, {})), 0.08), 0.01);
  EXPECT_GT(share_found(truth, in_order(waved(truth, {})), 0.036), 0.97);
}

TEST(ConsistentRegions, NeedTwoCameras) {
  const calib::CameraRig truth = rig_of(2);
  const auto frames = in_order(waved(truth, {.hidden = [](int camera, double) { return camera == 1; }}));
  EXPECT_EQ(share_found(truth, frames, 0.04), 0);
}

}  // namespace
}  // namespace huetrack::wave
