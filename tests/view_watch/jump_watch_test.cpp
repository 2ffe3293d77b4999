// Pictures in a wrong order are named; a ball that is thrown, bounces, or is hidden is not.
#include "view_watch/jump_watch.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

namespace huetrack::view_watch {
namespace {

using Path = std::function<Eigen::Vector2d(double)>;  // pixels at a time

// As two cameras see it, at 30 sets a second, in that order of sets.
std::optional<Jumps> watched(const Path& path, const std::vector<int>& order, bool is_tracked = true) {
  JumpWatch watch(2);
  std::optional<Jumps> found;
  for (std::size_t k = 0; k < order.size(); ++k) {
    std::vector<object_tracking::SeenRegion> regions;
    for (int camera = 0; camera < 2; ++camera) {
      const Eigen::Vector2d px = path(order[k] / 30.);
      if (px.allFinite())
        regions.push_back({.camera = camera, .px = (1 + 0.2 * camera) * px, .radius_px = 10, .is_target = is_tracked});
    }
    watch.look(regions, double(k) / 30, 0.04);
    if (watch.jumps()) found = watch.jumps();
  }
  return found;
}

std::vector<int> as_taken(int count = 150) {
  std::vector<int> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), 0);
  return order;
}

Eigen::Vector2d waved(double t) {
  return {320 + 250 * std::sin(2.2 * t), 240 + 150 * std::cos(1.7 * t)};
}

TEST(JumpWatch, NamesPicturesInTheOrderOfLetters) {
  std::vector<std::string> names;
  for (const int k : as_taken()) names.push_back(std::to_string(k + 1));
  std::ranges::sort(names);
  std::vector<int> order;
  for (const auto& name : names) order.push_back(std::stoi(name) - 1);
  const auto found = watched(waved, order);
  ASSERT_TRUE(found);
  EXPECT_GE(found->count, 4);
  EXPECT_GT(found->largest_m, 0.4);
}

TEST(JumpWatch, ABallsOwnMotionIsNone) {
  EXPECT_FALSE(watched(waved, as_taken()));
  // Thrown to and fro, within three frames each.
  EXPECT_FALSE(watched([](double t) { return Eigen::Vector2d(100 * std::clamp(10 * std::sin(9 * t), -4., 4.), 9); },
                       as_taken()));
  // Bounces.
  EXPECT_FALSE(watched([](double t) { return Eigen::Vector2d(9, 400 * std::abs(std::sin(12 * t))); }, as_taken()));
  // Hidden half of the time while it goes on.
  for (const double period_s : {0.1, 0.25, 0.5}) {
    const Path hidden = [&](double t) -> Eigen::Vector2d {
      return std::fmod(t, period_s) < period_s / 2 ? waved(3 * t) : Eigen::Vector2d::Constant(std::nan(""));
    };
    EXPECT_FALSE(watched(hidden, as_taken())) << period_s;
  }
}

// The tracker lists all regions of the colour while it searches the object.
TEST(JumpWatch, SpecksOfTheColourHideNoJump) {
  JumpWatch watch(2);
  for (int k = 0; k < 90; ++k) {
    const bool is_out_of_place = k % 15 == 7;
    std::vector<object_tracking::SeenRegion> regions;
    for (int camera = 0; camera < 2; ++camera) {
      regions.push_back({.camera = camera,
                         .px = waved((is_out_of_place ? k + 60 : k) / 30.),
                         .radius_px = is_out_of_place ? 16. : 10.,
                         .is_target = !is_out_of_place});
      for (int speck = 0; is_out_of_place && speck < 3; ++speck)
        regions.push_back({.camera = camera, .px = {20. * speck, 400}, .radius_px = 3});
    }
    watch.look(regions, k / 30., 0.04);
  }
  ASSERT_TRUE(watch.jumps());
  EXPECT_GE(watch.jumps()->count, 4);
}

TEST(JumpWatch, WhatIsNotTrackedIsNotTheObject) {
  std::vector<int> order = as_taken();
  for (std::size_t k = 7; k < 100; k += 10) order[k] += 40;
  EXPECT_TRUE(watched(waved, order));
  EXPECT_FALSE(watched(waved, order, false));
}

TEST(JumpWatch, OneJumpMayBeAnotherObject) {
  std::vector<int> order = as_taken(60);
  for (const int k : as_taken(60)) order.push_back(k + 300);
  EXPECT_FALSE(watched(waved, order));
}

}  // namespace
}  // namespace huetrack::view_watch
