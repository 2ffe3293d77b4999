#include "calib/wave/wave_coverage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace huetrack::wave {
namespace {

using namespace testing;

calib::CameraRig three_cameras() {
  calib::CameraRig rig;
  for (const char* name : {"left", "middle", "right"}) {
    calib::Camera& camera = rig.cameras.emplace_back();
    camera.name = name;
    camera.image_size = {600, 400};
  }
  return rig;
}

color::ColorRegion region(double u, double v, int area = 300) {
  color::ColorRegion out;
  out.area = area;
  out.centre = {u, v};
  return out;
}

// Through the whole picture of these cameras, near and far, in 200 frames of 30 Hz.
void wave_in(WaveCoverage& coverage, const std::vector<int>& cameras, double from_s) {
  for (int n = 0; n < 200 * int(cameras.size()); ++n) {
    const int i = n / int(cameras.size());
    coverage.add({.camera = cameras[std::size_t(n) % cameras.size()],
                  .t_s = from_s + i / 30.0,
                  .regions = {region(300 + 280 * std::sin(0.35 * i), 200 + 180 * std::cos(0.11 * i),
                                     int(300 + 250 * std::sin(0.05 * i)))}});
  }
}

TEST(WaveCoverage, SaysWhatIsMissing) {
  WaveCoverage coverage(three_cameras());
  EXPECT_THAT(coverage.needs(), ElementsAre("left has not seen it move yet", "middle has not seen it move yet",
                                            "right has not seen it move yet"));
  wave_in(coverage, {0}, 0);
  EXPECT_THAT(coverage.needs(), Contains("middle has not seen it move yet"));
  EXPECT_THAT(coverage.needs(), Contains(HasSubstr("where left and middle see it together: 0 of 40")));
  EXPECT_THAT(coverage.needs(), Not(Contains(HasSubstr("where middle and left see it"))));  // the same once more
  wave_in(coverage, {0, 1}, 10);
  EXPECT_EQ(coverage.shared(0, 1), coverage.shared(1, 0));
  EXPECT_GE(coverage.shared(0, 1), WaveCoverage::enough_shared);
  EXPECT_THAT(coverage.text(), HasSubstr("hardly together yet: left+right middle+right"));

  // Of the third a corner alone, always as large.
  for (int i = 0; i < 60; ++i)
    coverage.add({.camera = 2, .t_s = 20 + i / 30.0, .regions = {region(20 + 3 * (i % 20), 30 + (i % 20))}});
  EXPECT_THAT(coverage.needs(), Contains(HasSubstr("right: through the ")));
  EXPECT_THAT(coverage.needs(), Contains("right: nearer to it, and farther away"));
  EXPECT_THAT(coverage.needs(), Contains(HasSubstr("of 150 pictures of it moving")));
  EXPECT_THAT(coverage.needs(), Not(Contains(HasSubstr("left:"))));
  wave_in(coverage, {0, 1, 2}, 30);
  EXPECT_THAT(coverage.needs(), IsEmpty());
  EXPECT_THAT(coverage.text(), Not(HasSubstr("hardly")));
  EXPECT_TRUE(coverage.cameras()[2].is_seen_now);
  coverage.add({.camera = 2, .t_s = 39, .regions = {}});
  EXPECT_FALSE(coverage.cameras()[2].is_seen_now);
}

// Every camera has a partner with which it sees enough: the rig falls apart all the same.
TEST(WaveCoverage, PairsThatAreNotLinkedWithOneAnotherAreTold) {
  calib::CameraRig rig = three_cameras();
  rig.cameras.push_back(rig.cameras[0]);
  rig.cameras[3].name = "back";
  WaveCoverage coverage(rig);
  wave_in(coverage, {0, 1}, 0);
  wave_in(coverage, {2, 3}, 10);
  ASSERT_GE(coverage.shared(0, 1), WaveCoverage::enough_shared);
  ASSERT_GE(coverage.shared(2, 3), WaveCoverage::enough_shared);
  EXPECT_THAT(coverage.needs(), ElementsAre("wave it where left and right see it together: 0 of 40 moments"));
  wave_in(coverage, {1, 2}, 20);
  EXPECT_THAT(coverage.needs(), IsEmpty());
}

// A red cushion is the largest region of the colour in every picture, and trembles with the noise.
TEST(WaveCoverage, WhatRestsCountsNothing) {
  WaveCoverage coverage(three_cameras());
  for (int i = 0; i < 100; ++i)
    coverage.add({.camera = 0, .t_s = i / 30.0, .regions = {region(100 + 0.3 * (i % 3), 100, 4000)}});
  EXPECT_EQ(coverage.cameras()[0].sightings, 0);
  EXPECT_EQ(coverage.cameras()[0].frames, 100);
  EXPECT_EQ(coverage.cameras()[0].image_share(), 0);
  // The ball beside it counts.
  for (int i = 0; i < 50; ++i)
    coverage.add(
        {.camera = 0, .t_s = 4 + i / 30.0, .regions = {region(100, 100.2, 4000), region(200 + 5 * i, 300, 200)}});
  EXPECT_EQ(coverage.cameras()[0].sightings, 50);
  EXPECT_LT(coverage.cameras()[0].largest_px, 9);
}

// Two balls take turns, one rests: it is not taken for the other one that jumps.
TEST(WaveCoverage, EachBallIsHeldToItself) {
  WaveCoverage coverage(three_cameras());
  for (int i = 0; i < 50; ++i) {
    coverage.add({.camera = 0, .t_s = i / 30.0, .regions = {region(100, 100)}}, 0);
    coverage.add({.camera = 0, .t_s = i / 30.0, .regions = {region(400, 300)}}, 1);
  }
  EXPECT_LE(coverage.cameras()[0].sightings, 1);
}

}  // namespace
}  // namespace huetrack::wave
