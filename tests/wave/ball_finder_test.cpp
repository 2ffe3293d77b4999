#include "calib/wave/ball_finder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scene/lime.h"

namespace huetrack::wave {
namespace {

using scene::lime;

TEST(BallFinder, LocatesTheBallWithSubpixelAccuracy) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 2}).ball({}).build();
  BallFinder finder(scene.rig, lime());
  double sum = 0;
  int count = 0;
  for (const capture::FrameSet& set : scene::render(scene, {.set_count = 40})) {
    for (const auto& frame : set.frames) {
      const auto found = finder.detect(*frame);
      ASSERT_TRUE(found);
      ASSERT_FALSE(found->regions.empty());
      const auto px = scene.rig.cameras[static_cast<std::size_t>(frame->camera)].project_world(
          scene.ball_at(0, frame->captured_at));
      ASSERT_TRUE(px);
      sum += (found->regions.front().centre - px->px).squaredNorm();
      ++count;
    }
  }
  EXPECT_LT(std::sqrt(sum / count), 0.3);
}

TEST(BallFinder, RefinesOutlinesWithTheBackground) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 2}).ball({}).build();
  BallFinder finder(scene.rig, lime());
  BackgroundSamples background(2);
  std::vector<BallFrame> frames;
  std::vector<Eigen::Vector2d> truth;
  for (const capture::FrameSet& set : scene::render(scene, {.set_count = 40})) {
    for (const auto& frame : set.frames) {
      background.add(*frame);
      frames.push_back(*finder.detect(*frame));
      ASSERT_FALSE(frames.back().regions.empty());
      truth.push_back(scene.rig.cameras[static_cast<std::size_t>(frame->camera)]
                          .project_world(scene.ball_at(0, frame->captured_at))
                          ->px);
    }
  }
  const auto rms = [&] {
    double sum = 0;
    for (std::size_t i = 0; i < frames.size(); ++i) sum += (frames[i].regions.front().centre - truth[i]).squaredNorm();
    return std::sqrt(sum / static_cast<double>(frames.size()));
  };
  refine_outlines(frames, background, scene.rig);
  EXPECT_LT(rms(), 0.15);
  EXPECT_TRUE(frames.front().patches.empty());
}

TEST(BackgroundSamples, NeedsEightSamples) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 1}).ball({}).build();
  BackgroundSamples background(1);
  for (const capture::FrameSet& set : scene::render(scene, {.set_count = 7})) background.add(*set.frames.front());
  EXPECT_FALSE(background.of(0));
}

TEST(BallFinder, SkipsUnusableFrames) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 1}).ball({}).build();
  BallFinder finder(scene.rig, lime());
  capture::Frame frame = *scene::render(scene, {.set_count = 1}).front().frames.front();
  frame.status = capture::FrameStatus::corrupted;
  EXPECT_FALSE(finder.detect(frame));
  EXPECT_EQ(finder.unusable_frames(), 1u);
}

color::ColorRegion region_at(double u, double v) {
  color::ColorRegion region;
  region.area = 30;
  region.centre = {u, v};
  region.spread.setIdentity();
  return region;
}

TEST(StillRegions, AreRemovedWhereTheyAppearInMostFrames) {
  std::vector<BallFrame> frames;
  for (int i = 0; i < 100; ++i) {
    BallFrame frame{0, i / 30.0, {}};
    if (i % 3 != 0) frame.regions.push_back(region_at(50 + 0.3 * (i % 2), 60));  // a thing of the ball's colour
    // The ball rests for a third of the time.
    frame.regions.push_back(i < 34 ? region_at(200, 100) : region_at(200 + 2 * (i - 34), 100 + i));
    frames.push_back(frame);
    frames.push_back({1, i / 30.0, {region_at(10 + 2 * i, 30)}});
  }
  EXPECT_EQ(remove_still_regions(frames, 2), (std::vector<int>{1, 0}));
  for (const BallFrame& frame : frames) {
    ASSERT_EQ(frame.regions.size(), 1u);
    if (frame.camera == 0) {
      EXPECT_GE(frame.regions.front().centre.x(), 200);
    }
  }
}

// Wood of the ball's colour: its rim flickers with the light, so that its centre moves.
TEST(StillPixels, ARegionOfThemIsRemoved) {
  const calib::CameraRig rig = scene::SceneBuilder{}.cameras_on_ring({.count = 1}).ball({}).build().rig;
  const auto patch = [](int u_min, int width) {
    BallPatch out;
    out.u_min = u_min, out.v_min = 50, out.width = width, out.height = 10;
    out.pixels.assign(static_cast<std::size_t>(width) * 10, {200, 0, 0, true});
    return out;
  };
  std::vector<BallFrame> frames;
  for (int i = 0; i < 40; ++i) {
    const int rim = i % 5;
    BallFrame& frame = frames.emplace_back(BallFrame{0, i / 30.0, {}});
    frame.patches = {patch(100 - 4 * rim, 10 + 4 * rim), patch(200 + 4 * i, 10)};
    frame.regions = {region_at(105 - 2 * rim, 55), region_at(205 + 4 * i, 55)};
  }
  refine_outlines(frames, BackgroundSamples(1), rig);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    ASSERT_EQ(frames[i].regions.size(), 1u) << i;
    EXPECT_EQ(frames[i].regions.front().centre.x(), 205 + 4 * static_cast<double>(i));
  }
}

}  // namespace
}  // namespace huetrack::wave
