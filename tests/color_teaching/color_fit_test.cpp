#include "color_teaching/color_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace huetrack::color_teaching {
namespace {

using namespace testing;

color::Hsi hsi(double hue, double saturation, double intensity) {
  return {hue, saturation, intensity, saturation > 0};
}

// A disc of one colour with shading and noise, before another colour.
HsiImage disc(double hue, double saturation, color::Hsi ground, int seed = 1) {
  HsiImage image{100, 80, std::vector<color::Hsi>(8000, ground)};
  std::mt19937 rng(static_cast<unsigned>(seed));
  std::normal_distribution<double> noise;
  for (int v = 0; v < 80; ++v) {
    for (int u = 0; u < 100; ++u) {
      color::Hsi& p = image.pixels[std::size_t(v * 100 + u)];
      const double r = std::hypot(u - 50, v - 40);
      if (r <= 12) p = hsi(std::fmod(hue + 2 * noise(rng) + 360, 360), saturation, 0.25 + 0.3 * (60 - v) / 40);
      p.saturation = std::clamp(p.saturation + 0.01 * noise(rng), 0.0, 1.0);
    }
  }
  return image;
}

PixelMask outside(const PixelMask& region) {
  PixelMask background = grown(region, 4);
  for (auto& p : background.pixels) p = p == 0 ? 1 : 0;
  return background;
}

TEST(GrowRegion, FindsTheWholeObjectAndNothingElse) {
  const auto region = grow_region(disc(90, 0.7, hsi(30, 0.3, 0.5)), {53, 44});
  ASSERT_TRUE(region);
  EXPECT_NEAR(double(region->count()), 3.14 * 12 * 12, 25);
  EXPECT_EQ(region->at(50, 40), 1);
  EXPECT_EQ(region->at(50, 54), 0);
}

TEST(GrowRegion, RedIsNoSpecialCase) {
  const auto region = grow_region(disc(359, 0.8, hsi(30, 0.3, 0.5)), {50, 40});
  ASSERT_TRUE(region);
  EXPECT_NEAR(double(region->count()), 3.14 * 12 * 12, 25);
}

// What moved before a larger thing of nearly its colour.
TEST(GrowRegion, StaysWithinWhatItIsGiven) {
  const HsiImage image = disc(60, 0.7, hsi(60, 0.68, 0.5));
  PixelMask within(image.width, image.height);
  for (int v = 0; v < image.height; ++v)
    for (int u = 0; u < image.width; ++u) within.at(u, v) = std::hypot(u - 50, v - 40) <= 12 ? 1 : 0;
  EXPECT_FALSE(grow_region(image, {50, 40}));
  const auto region = grow_region(image, {50, 40}, &within);
  ASSERT_TRUE(region);
  EXPECT_NEAR(double(region->count()), 3.14 * 12 * 12, 25);
}

TEST(GrowRegion, GreyAndWhatFillsThePictureIsRefused) {
  const HsiImage image = disc(90, 0.7, hsi(200, 0.02, 0.5));
  EXPECT_FALSE(grow_region(image, {5, 5}));                             // grey
  EXPECT_FALSE(grow_region(disc(90, 0.7, hsi(30, 0.5, 0.5)), {5, 5}));  // the ground
  EXPECT_FALSE(grow_region(image, {-1, 5}));
  EXPECT_FALSE(grow_region(image, {100, 5}));
}

TEST(FitRange, HoldsTheObjectAndLeavesTheBackgroundOut) {
  // The ground has nearly the object's hue, but less saturation: hue alone would take it in.
  for (const double hue : {90.0, 2.0, 240.0}) {
    const HsiImage image = disc(hue, 0.8, hsi(std::fmod(hue + 8, 360), 0.45, 0.4));
    const auto region = grow_region(image, {50, 40});
    ASSERT_TRUE(region);
    const color::HsiRange range = fit_range(image, *region, outside(*region), 0);
    EXPECT_THAT(range.problems(), IsEmpty());
    const PixelMask mask = matching(image, range, {});
    std::size_t inside = 0, beside = 0;
    for (std::size_t i = 0; i < mask.pixels.size(); ++i) (region->pixels[i] != 0 ? inside : beside) += mask.pixels[i];
    EXPECT_GT(double(inside), 0.97 * double(region->count()));
    EXPECT_LT(beside, 5u);
    EXPECT_GT(range.saturation_min, 0.45);
  }
}

TEST(FitRange, TakesTheRoomThatThereIs) {
  const HsiImage image = disc(90, 0.8, hsi(250, 0.3, 0.4));  // nothing in the way
  const auto region = grow_region(image, {50, 40});
  ASSERT_TRUE(region);
  const color::HsiRange range = fit_range(image, *region, outside(*region), 0);
  EXPECT_TRUE(color::contains(range, hsi(110, 0.8, 0.4)));  // other light
  EXPECT_TRUE(color::contains(range, hsi(90, 0.5, 0.9)));
  EXPECT_TRUE(color::contains(range, hsi(75, 0.9, 0.17)));
  EXPECT_FALSE(color::contains(range, hsi(150, 0.8, 0.4)));  // but not any
  EXPECT_FALSE(color::contains(range, hsi(90, 0.2, 0.4)));
}

TEST(FitRange, StepsWidenAndNarrow) {
  const HsiImage image = disc(90, 0.8, hsi(95, 0.6, 0.4));
  const auto region = grow_region(image, {50, 40});
  ASSERT_TRUE(region);
  std::size_t last = 0;
  for (const int steps : {-20, -3, -1, 0, 2, 5, 100}) {
    const color::HsiRange range = fit_range(image, *region, outside(*region), steps);
    EXPECT_THAT(range.problems(), IsEmpty()) << steps;
    const std::size_t count = matching(image, range, {}).count();
    EXPECT_GE(count, last) << steps;
    last = count;
  }
  EXPECT_GT(last, 4000u);
}

TEST(Matching, IgnoresTheBoxes) {
  const HsiImage image = disc(90, 0.8, hsi(250, 0.3, 0.4));
  const color::HsiRange any{.hue_min_deg = 60, .hue_max_deg = 120};
  EXPECT_GT(matching(image, any, {}).count(), 400u);
  EXPECT_EQ(matching(image, any, {{30, 20, 70, 60}}).count(), 0u);
  EXPECT_EQ(matching(image, any, {{-30, -20, 700, 600}}).count(), 0u);  // larger than the image
}

TEST(Regions, AreConnectedOverCornersAndSortedBySize) {
  PixelMask mask(10, 10);
  mask.at(0, 0) = mask.at(1, 1) = 1;
  mask.at(5, 5) = mask.at(6, 5) = mask.at(5, 6) = mask.at(6, 6) = 1;
  mask.at(9, 0) = 1;
  const auto regions = regions_of(mask, 2);
  ASSERT_EQ(regions.size(), 2u);
  EXPECT_EQ(regions[0].area, 4);
  EXPECT_EQ(regions[0].centre, Eigen::Vector2d(5.5, 5.5));
  EXPECT_EQ(regions[1].box.u_max, 1);
  EXPECT_EQ(grown(mask, 1).at(8, 1), 1);
  EXPECT_EQ(grown(mask, 1).at(7, 1), 0);
}

}  // namespace
}  // namespace huetrack::color_teaching
