#include "object_tracking/covered_ball.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <optional>
#include <random>

#include "capture/frames/pixel_format.h"
#include "object_tracking/ball_outline.h"

namespace huetrack::object_tracking {
namespace {

using Eigen::Vector2d;

constexpr int width = 160, height = 120;
constexpr double radius = 8;
const Vector2d ball_px(80.3, 59.7);
constexpr capture::Bgr orange{20, 130, 240}, skin{120, 150, 190};
constexpr color::HsiRange orange_range{.hue_min_deg = 15,
                                       .hue_max_deg = 45,
                                       .saturation_min = 0.5,
                                       .saturation_max = 1,
                                       .intensity_min = 0.15,
                                       .intensity_max = 0.9};

const color::ColorTable& orange_table() {
  static const color::ColorTable table(orange_range, capture::PixelFormat::bgr, capture::ColorRange::full);
  return table;
}

using Where = std::function<bool(const Vector2d&)>;
bool nowhere(const Vector2d&) {
  return false;
}

// With a share of the ball's chroma, and its own light.
capture::Bgr tinted(capture::Bgr p, double share) {
  const double light = 0.114 * orange.b + 0.587 * orange.g + 0.299 * orange.r;
  const auto add = [&](std::uint8_t to, std::uint8_t of) { return std::uint8_t(to + share * (of - light)); };
  return {add(p.b, orange.b), add(p.g, orange.g), add(p.r, orange.r)};
}

// A wall with stripes, a ball, and what is in front of both; noise of 2 grey values.
capture::Image picture(unsigned seed, bool has_ball, const Where& is_hand, const Where& is_pillar = nowhere,
                       double halo = 0) {
  std::mt19937_64 rng(seed);
  capture::WritableImage out = capture::make_image(capture::PixelFormat::bgr, capture::ColorRange::full, width, height);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const Vector2d at(u, v);
      const auto wall = std::uint8_t(100 + 30 * std::sin(0.4 * u) * std::cos(0.3 * v));
      capture::Bgr p{wall, wall, wall};
      if (has_ball && (at - ball_px).norm() <= radius)
        p = orange;
      else if (has_ball && (at - ball_px).norm() <= 2 * radius)
        p = tinted(p, halo);
      if (is_pillar(at)) p = {60, 40, 40};
      if (is_hand(at)) p = skin;
      std::uint8_t* const to = out.data[0] + v * out.image.planes[0].stride + 3 * u;
      for (int i = 0; const std::uint8_t value : {p.b, p.g, p.r}) to[i++] = std::uint8_t(value + int(rng() % 7) - 3);
    }
  }
  return out.image;
}

struct Measured {
  Vector2d region;  // centroid
  std::optional<DiscPlace> disc;
};

Measured measure(const Where& is_hand, const Where& is_pillar = nowhere, int pictures = 20, double halo = 0) {
  outline::Background background(width, height);
  for (int i = 0; i < pictures; ++i)
    background.learn_all(picture_of(picture(unsigned(i + 1), false, nowhere, is_pillar)), nullptr, 0);
  const capture::Image image = picture(1000, true, is_hand, is_pillar, halo);
  color::MatchBits matches(width, height);
  matches.look_at(image, orange_table());
  color::RegionFinder finder;
  const auto& regions = finder.find(matches, {0, 0, width - 1, height - 1}, 1, 0);
  TargetView view{};
  view.matches = &matches, view.image = &image;
  CoveredBall covered;
  return {regions.at(0).centre,
          covered.measure(view, picture_of(image), {.values = &background}, {regions.at(0).centre, radius})};
}

// A hand that covers what lies less than `cut` radii along `angle` from the centre, and reaches three radii around.
Where hand(double angle, double cut) {
  const Vector2d axis(std::cos(angle), std::sin(angle));
  return [=](const Vector2d& at) {
    const Vector2d d = at - ball_px;
    return d.dot(axis) < cut * radius && d.norm() < 3 * radius;
  };
}

TEST(CoveredBall, HasItsCentreWhereAHandCoversAHalf) {
  for (const double cut : {-0.5, 0.0, 0.3}) {
    for (double angle = 0.2; angle < 2 * std::numbers::pi; angle += 0.9) {
      const Measured m = measure(hand(angle, cut));
      ASSERT_TRUE(m.disc) << cut << " " << angle;
      const Vector2d off = m.disc->px - ball_px;
      EXPECT_LT(off.norm(), 0.15 * radius) << cut << " " << angle;
      EXPECT_LT(off.norm(), 0.6 * (m.region - ball_px).norm()) << cut << " " << angle;
      EXPECT_LT(off.dot((m.disc->covariance).inverse() * off), 16) << cut << " " << angle;
    }
  }
}

// Fingers across the ball leave two parts of it.
TEST(CoveredBall, HasItsCentreBehindAFinger) {
  const auto m = measure(
      [](const Vector2d& at) { return std::abs(at.x() - ball_px.x() - 3) < 3 && at.y() > ball_px.y() - 2 * radius; });
  // The finger is a quarter of the ring: less than what counts as something around it.
  EXPECT_FALSE(m.disc);
  const auto palm = measure([](const Vector2d& at) {
    const Vector2d d = at - ball_px;
    return (std::abs(d.x() - 3) < 3 && d.y() > -2 * radius) ||
           (d.norm() > radius && d.norm() < 2 * radius && d.x() > 0);
  });
  ASSERT_TRUE(palm.disc);
  EXPECT_LT((palm.disc->px - ball_px).norm(), 0.15 * radius);
}

// Through a hole in the hand, which shows nothing of the edge, the centre may be anywhere within what is left of the
// disc.
TEST(CoveredBall, IsUnsureWhereNothingOfTheEdgeIsVisible) {
  const Vector2d hole = ball_px + Vector2d(0.2, -0.3) * radius;
  const Measured m = measure(
      [&](const Vector2d& at) { return (at - hole).norm() > 0.4 * radius && (at - ball_px).norm() < 2.5 * radius; });
  ASSERT_TRUE(m.disc);
  const double sigma = std::sqrt(m.disc->covariance.trace() / 2);
  EXPECT_GT(sigma, 0.2 * radius);
  EXPECT_LT((m.disc->px - ball_px).norm(), 3 * sigma);
}

TEST(CoveredBall, IsNotMeasuredWithoutAHandOrABackground) {
  EXPECT_FALSE(measure(nowhere).disc);
  EXPECT_FALSE(measure(hand(0, 0), nowhere, 0).disc);
}

// Shared chroma samples and JPEG spread the ball's chroma around it.
TEST(CoveredBall, IsNotMeasuredBecauseItsOwnColourSpreads) {
  EXPECT_FALSE(measure(nowhere, nowhere, 20, 0.1).disc);
}

// A pillar that was always there is background: what it covers looks as if the ball were not there.
TEST(CoveredBall, SaysHowMuchOfTheDiscShowsTheBackground) {
  const Where pillar = [](const Vector2d& at) { return at.x() < ball_px.x(); };
  EXPECT_FALSE(measure(nowhere, pillar).disc);
  const Measured m = measure(hand(0.5 * std::numbers::pi, -0.2), pillar);
  ASSERT_TRUE(m.disc);
  EXPECT_GT(m.disc->bare, 0.12);
  EXPECT_LT(measure(hand(0, 0)).disc->bare, 0.1);
}

}  // namespace
}  // namespace huetrack::object_tracking
