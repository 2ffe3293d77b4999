#include "calib/wave/timing_diagnostics.h"
#include "drawn.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace huetrack::wave {
namespace {

using Eigen::Vector2d;

constexpr double frame_s = 1.0 / 30;

// A ball that circles at some speed; late_s(t): by which a frame was exposed later than its stamp says.
std::vector<TimingSample> circling(double px_s, double noise_px, const std::function<double(double)>& late_s,
                                   double seconds = 20) {
  std::mt19937_64 rng(4);
  std::normal_distribution<double> noise(0, noise_px);
  std::vector<TimingSample> samples;
  for (int i = 0; i < static_cast<int>(30 * seconds); ++i) {
    const double t = i * frame_s;
    const Vector2d velocity = px_s * Vector2d(std::cos(2.1 * t), std::sin(2.1 * t));
    samples.push_back({t, late_s(t) * velocity + drawn<2>(rng, noise), velocity});
  }
  return samples;
}

TEST(TimingDiagnostics, NoiseAloneIsNoSign) {
  const TimingDiagnostics signs = timing_diagnostics(circling(300, 0.2, [](double) { return 0.0; }), frame_s);
  EXPECT_LT(signs.wander_s, 2e-4);
  EXPECT_LT(signs.wander_sigmas, 1.5);
  EXPECT_GT(signs.wander_sigmas, 0.2);
  EXPECT_LT(signs.scatter_s, 3e-4);
  EXPECT_EQ(signs.repeated, 0);
  EXPECT_EQ(signs.lag_s.size(), 20u);
}

TEST(TimingDiagnostics, LagThatChangesFromSecondToSecondIsMeasured) {
  const TimingDiagnostics signs = timing_diagnostics(
      circling(300, 0.2, [](double t) { return static_cast<int>(t) % 2 == 0 ? 0.003 : -0.003; }), frame_s);
  EXPECT_NEAR(signs.wander_s, 0.003, 3e-4);
  EXPECT_GT(signs.wander_sigmas, 8);
  for (const auto& [second, lag_s] : signs.lag_s) EXPECT_NEAR(lag_s, second % 2 == 0 ? 0.003 : -0.003, 5e-4);
}

TEST(TimingDiagnostics, LagThatChangesFromFrameToFrameIsScatter) {
  std::mt19937_64 rng(9);
  std::normal_distribution<double> jitter(0, 0.004);
  const TimingDiagnostics signs = timing_diagnostics(circling(300, 0.2, [&](double) { return jitter(rng); }), frame_s);
  EXPECT_NEAR(signs.scatter_s, 0.004, 6e-4);
}

TEST(TimingDiagnostics, RepeatedFramesAreCounted) {
  int i = 0;
  const TimingDiagnostics signs =
      timing_diagnostics(circling(400, 0.2, [&](double) { return ++i % 4 == 0 ? -frame_s : 0.0; }), frame_s);
  EXPECT_NEAR(signs.repeated, 0.25, 0.02);
}

TEST(TimingDiagnostics, SlowBallShowsNoTimes) {
  const TimingDiagnostics signs = timing_diagnostics(circling(30, 0.2, [](double) { return 0.01; }), frame_s);
  EXPECT_TRUE(signs.lag_s.empty());
  EXPECT_EQ(signs.wander_s, 0);
  EXPECT_EQ(timing_diagnostics({}, frame_s).wander_s, 0);
}

// Pixels are a unit like any other: an image of twice the size shows the same times.
TEST(TimingDiagnostics, DoNotDependOnTheImagesResolution) {
  const auto late = [](double t) { return 0.002 * std::sin(t); };
  const TimingDiagnostics once = timing_diagnostics(circling(300, 0.2, late), frame_s);
  const TimingDiagnostics twice = timing_diagnostics(circling(600, 0.4, late), frame_s);
  EXPECT_NEAR(once.wander_s, twice.wander_s, 1e-9);
  EXPECT_NEAR(once.wander_sigmas, twice.wander_sigmas, 1e-6);
  EXPECT_NEAR(once.scatter_s, twice.scatter_s, 1e-9);
}

}  // namespace
}  // namespace huetrack::wave
