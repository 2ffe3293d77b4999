#include "object_tracking/trackers/color_watch.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "object_tracking/trackers/color_follower.h"
#include "object_tracking/trackers/object_tracker.h"
#include "scene/scene.h"
#include "scene/turned_hue.h"

namespace huetrack::object_trackers {

using namespace object_tracking;

namespace {

using testing::Each;
using testing::ElementsAre;

constexpr double fps = 30;

// A grey image with a disc of one colour.
capture::WritableImage disc(color::Rgb color, double u0, double v0, double radius) {
  capture::WritableImage image = capture::make_image(capture::PixelFormat::bgr, capture::ColorRange::full, 64, 64);
  for (int v = 0; v < 64; ++v) {
    for (int u = 0; u < 64; ++u) {
      const bool is_in = std::hypot(u - u0, v - v0) <= radius;
      std::uint8_t* p = image.data[0] + v * image.image.planes[0].stride + 3 * u;
      p[0] = is_in ? std::uint8_t(255 * color.b) : 90;
      p[1] = is_in ? std::uint8_t(255 * color.g) : 90;
      p[2] = is_in ? std::uint8_t(255 * color.r) : 90;
    }
  }
  return image;
}

TEST(ColorInside, MeasuresTheDiscWhateverItsColour) {
  const auto image = disc({0.2, 0.6, 0.1}, 30, 30, 8);
  const color::Hsi expected = color::hsi_of({51 / 255.0, 153 / 255.0, 25 / 255.0});
  const auto seen = color_inside(image.image, {30, 30}, 5, 90);
  ASSERT_TRUE(seen);
  EXPECT_NEAR(seen->median[0], expected.hue_deg - 90, 1e-9);
  EXPECT_NEAR(seen->median[1], expected.saturation, 1e-9);
  EXPECT_NEAR(seen->median[2], expected.intensity, 1e-9);
  EXPECT_THAT(seen->below, Each(testing::DoubleNear(0, 1e-9)));
  EXPECT_THAT(seen->above, Each(testing::DoubleNear(0, 1e-9)));
  // The hue is relative to its origin, through 0.
  EXPECT_NEAR(color_inside(image.image, {30, 30}, 5, 350)->median[0], expected.hue_deg + 10, 1e-9);
}

TEST(ColorInside, IgnoresWhatHidesLessThanHalf) {
  auto image = disc({0.2, 0.6, 0.1}, 30, 30, 8);
  for (int v = 0; v < 64; ++v)
    for (int u = 32; u < 64; ++u) image.data[0][v * image.image.planes[0].stride + 3 * u] = 200;  // blue
  const auto seen = color_inside(image.image, {30, 30}, 5, 90);
  ASSERT_TRUE(seen);
  EXPECT_NEAR(seen->median[0], color::hsi_of({51 / 255.0, 153 / 255.0, 25 / 255.0}).hue_deg - 90, 1e-9);
  EXPECT_NEAR(seen->above[0], 0, 1e-9);
}

TEST(ColorInside, MeasuresNothingAtTheBorderNorOfGreys) {
  const auto image = disc({0.2, 0.6, 0.1}, 3, 30, 8);
  EXPECT_FALSE(color_inside(image.image, {3, 30}, 5, 90));
  EXPECT_FALSE(color_inside(image.image, {std::nanf(""), 30}, 5, 90));
  const auto grey = color_inside(image.image, {45, 30}, 5, 90);
  ASSERT_TRUE(grey);
  EXPECT_TRUE(std::isnan(grey->median[0]));
  EXPECT_EQ(grey->median[1], 0);
}

TEST(AxisRange, CountsHuesFromTheMiddleAndKnowsWhereAxesEnd) {
  const color::HsiRange red{340, 20, 0.3, 1, 0, 0.9};
  EXPECT_EQ(middle_hue_deg(red), 0);
  EXPECT_EQ(middle_hue_deg({65, 115, 0, 1, 0, 1}), 90);
  const AxisRange hue = axis_range(red, ColorAxis::hue, 0);
  EXPECT_EQ(hue.min, -20);
  EXPECT_EQ(hue.max, 20);
  const AxisRange saturation = axis_range(red, ColorAxis::saturation, 0);
  EXPECT_TRUE(saturation.has_min);
  EXPECT_FALSE(saturation.has_max);
  const AxisRange intensity = axis_range(red, ColorAxis::intensity, 0);
  EXPECT_FALSE(intensity.has_min);
  EXPECT_TRUE(intensity.has_max);
  EXPECT_FALSE(axis_range({0, 360, 0, 1, 0, 1}, ColorAxis::hue, 180).has_min);
}

TEST(ColorFollower, ARangeMovesAndKeepsItsWidth) {
  EXPECT_EQ(shifted({350, 20, 0.3, 0.8, 0.1, 0.9}, {15, 0.1, -0.05}), (color::HsiRange{5, 35, 0.4, 0.9, 0.05, 0.85}));
  EXPECT_EQ(shifted({5, 35, 0.3, 1, 0, 0.9}, {-15, -0.1, 0.05}).hue_min_deg, 350);
  EXPECT_EQ(shifted({5, 35, 0.3, 1, 0, 0.9}, {-15, -0.1, 0.05}).saturation_max, 1);  // nothing is beyond it
  EXPECT_EQ(shifted({5, 35, 0.3, 1, 0, 0.9}, {-15, -0.1, 0.05}).intensity_min, 0);
  EXPECT_EQ(shifted({0, 360, 0.3, 1, 0, 1}, {10, 0, 0}).hue_max_deg, 360);
  for (const double degrees : {-20.0, -7.5, 0.0, 13.0, 20.0})
    for (const color::HsiRange& range : {color::HsiRange{340, 20, 0.3, 1, 0.1, 0.9},
                                         color::HsiRange{300, 360, 0, 1, 0, 1}, color::HsiRange{0, 60, 0, 1, 0, 1}})
      EXPECT_TRUE(shifted(range, {degrees, 0.15, -0.2}).problems().empty()) << range.hue_min_deg << " by " << degrees;
}

SeenColor seen_at(double hue, double saturation, double intensity) {
  return {{hue, saturation, intensity}, {3, 0.03, 0.03}, {3, 0.03, 0.03}};
}

TEST(ColorFollower, MovesAsLittleAsItMust) {
  const color::HsiRange taught{65, 115, 0.3, 1, 0.1, 0.95};
  EXPECT_THAT(wanted_shift(taught, seen_at(0, 0.7, 0.5)), Each(0));
  EXPECT_THAT(wanted_shift(taught, seen_at(11, 0.7, 0.5)), Each(0));  // 14 from the end: twice 3 and the noise
  EXPECT_NEAR(wanted_shift(taught, seen_at(22, 0.7, 0.5))[0], 10, 1e-9);
  EXPECT_NEAR(wanted_shift(taught, seen_at(-22, 0.7, 0.5))[0], -10, 1e-9);
  EXPECT_EQ(wanted_shift(taught, seen_at(90, 0.7, 0.5))[0], furthest_followed[0]);  // another colour
  EXPECT_NEAR(wanted_shift(taught, seen_at(0, 0.37, 0.5))[1], -0.05, 1e-9);
  EXPECT_NEAR(wanted_shift(taught, seen_at(0, 0.02, 0.5))[1], -0.15, 1e-9);
  EXPECT_NEAR(wanted_shift({65, 115, 0.2, 1, 0.1, 0.9}, seen_at(0, 0.02, 0.5))[1], -0.05, 1e-9);  // greys begin
  EXPECT_EQ(wanted_shift(taught, seen_at(0, 1, 0.5))[1], 0);  // a colour cannot be too strong
  EXPECT_LT(wanted_shift(taught, seen_at(0, 0.7, 0.12))[2], 0);
  EXPECT_THAT(wanted_shift(taught, {{std::nan(""), 0.7, 0.5}, {}, {}}), Each(0));
  // A range that is narrower than the object: in the middle of it.
  EXPECT_NEAR(wanted_shift({88, 92, 0.3, 1, 0.1, 0.95}, seen_at(5, 0.7, 0.5))[0], 5, 1e-9);
}

// ---- A ball that the cameras' white balance carries away

TargetOptions lime(bool adapts) {
  TargetOptions target;
  target.name = "lime";
  target.radius_m = 0.08;
  target.color = {65, 115, 0.3, 1, 0.1, 0.95};  // the ball's hue is 92
  target.adapts_color = adapts;
  return target;
}

class Wandering : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    world = scene::circling_ball();
    second = scene::render(world, {.set_count = int(fps), .fps = fps});
  }
  static void TearDownTestSuite() { second.clear(); }

  struct Course {
    std::vector<TrackState> states;
    std::vector<std::vector<ColorHealth>> healths;
    double first_time(const std::function<bool(std::size_t)>& is_so) const {
      for (std::size_t k = 0; k < states.size(); ++k)
        if (is_so(k)) return double(k) / fps;
      return std::numeric_limits<double>::infinity();
    }
    double lost_at() const {
      return first_time([this](std::size_t k) { return double(k) > fps && states[k] != TrackState::tracking; });
    }
    double warned_at(std::size_t camera) const {
      return first_time([&](std::size_t k) { return healths[k][camera].near_end.has_value(); });
    }
    bool operator==(const Course& other) const { return states == other.states; }
  };
  static Course follow(const TargetOptions& target, const std::vector<capture::FrameSet>& film) {
    ObjectTracker tracker(world.rig, target, {});
    Course course;
    for (const capture::FrameSet& set : film) {
      course.states.push_back(tracker.update(set).state);
      course.healths.push_back(tracker.color_health());
    }
    return course;
  }

  static scene::Scene world;
  static std::vector<capture::FrameSet> second;
};
scene::Scene Wandering::world;
std::vector<capture::FrameSet> Wandering::second;

double turning(double t) {
  return 3 * std::clamp(t - 1, 0.0, 12.0);  // to 36 degrees
}

TEST_F(Wandering, WarnsBeforeTheObjectIsLost) {
  const Course course = follow(lime(false), scene::wandering(second, fps, 12, turning));
  EXPECT_LT(course.lost_at(), 11.5);
  for (std::size_t camera = 0; camera < 3; ++camera) {
    EXPECT_LT(course.warned_at(camera), course.lost_at() - 0.5);
    EXPECT_GT(course.warned_at(camera), 2);
  }
  const auto at = std::size_t(fps * course.warned_at(1));
  const ColorHealth& health = course.healths[at][1];
  EXPECT_EQ(health.near_end->axis, ColorAxis::hue);
  EXPECT_TRUE(health.near_end->is_upper);
  EXPECT_NEAR(health.near_end->left, 25 - health.seen->median[0], 1e-9);
  EXPECT_NEAR(health.seen->median[0], 92 - 90 + turning(course.warned_at(1)), 6);  // smoothed: it lags
}

TEST_F(Wandering, WarnsForThatCameraAndClears) {
  const auto there_and_back = [](double t) {  // to 22 degrees, where 1 is left
    return std::clamp(t < 6 ? 5 * (t - 1) : 5 * (12 - t), 0.0, 22.0);
  };
  ObjectTracker tracker(world.rig, lime(false), {});
  bool was_near = false;
  for (const auto& set : scene::wandering(second, fps, 14, there_and_back, 1)) {
    tracker.update(set);
    const auto health = tracker.color_health();
    EXPECT_FALSE(health[0].near_end);
    EXPECT_FALSE(health[2].near_end);
    was_near |= health[1].near_end.has_value();
  }
  EXPECT_TRUE(was_near);
  EXPECT_FALSE(tracker.color_health()[1].near_end);
  EXPECT_EQ(tracker.color_change_count(), 2u);
}

TEST_F(Wandering, DoesNotWarnOfAConstantColour) {
  const Course course = follow(lime(true), scene::wandering(second, fps, 4, [](double) { return 0.0; }));
  for (const auto& healths : course.healths) {
    for (const ColorHealth& health : healths) {
      EXPECT_FALSE(health.near_end);
      EXPECT_THAT(health.followed, Each(0));
    }
  }
  EXPECT_TRUE(course.healths.back()[0].seen);
}

TEST_F(Wandering, AdaptingKeepsTheObject) {
  const auto film = scene::wandering(second, fps, 15, turning);
  const Course course = follow(lime(true), film);
  EXPECT_EQ(course.lost_at(), std::numeric_limits<double>::infinity());
  for (const ColorHealth& health : course.healths.back()) {
    EXPECT_GT(health.followed[0], 12);
    EXPECT_LE(health.followed[0], furthest_followed[0]);
  }
  // And the same way every time.
  EXPECT_EQ(follow(lime(true), film), course);
}

TEST_F(Wandering, BackgroundOfOneViewIsNotLearnt) {
  // Only one camera sees the ball, and its colour turns: no view confirms its position.
  auto film = scene::wandering(second, fps, 8, [](double t) { return t < 3 ? 0 : 3 * (t - 3); });
  for (auto& set : film)
    if (capture::seconds(set.at) > 3) set.frames[1].reset(), set.frames[2].reset();
  const Course course = follow(lime(true), film);
  for (const ColorHealth& health : course.healths.back()) EXPECT_THAT(health.followed, Each(0));
}

TEST_F(Wandering, UsesTheTaughtRangeAfterALongLoss) {
  auto film = scene::wandering(second, fps, 21, [](double t) { return std::min(turning(t), 20.0); });
  const double gone_s = 9;
  for (auto& set : film) {
    if (capture::seconds(set.at) <= gone_s) continue;
    for (auto& frame : set.frames) {
      const auto grey = capture::make_image(capture::PixelFormat::yuyv, capture::ColorRange::limited, 320, 240);
      std::fill_n(grey.data[0], grey.image.planes[0].stride * grey.image.height, std::uint8_t{128});
      frame->pixels = grey.image;
    }
  }
  const Course course = follow(lime(true), film);
  EXPECT_GT(course.healths[std::size_t(gone_s * fps)][0].followed[0], 2);
  EXPECT_GT(course.healths[std::size_t((gone_s + 9) * fps)][0].followed[0], 2);
  for (const ColorHealth& health : course.healths.back()) EXPECT_THAT(health.followed, Each(0));
}

}  // namespace
}  // namespace huetrack::object_trackers
