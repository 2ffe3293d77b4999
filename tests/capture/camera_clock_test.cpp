#include "capture/timing/camera_clock.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace huetrack::capture {
namespace {

using namespace std::chrono_literals;

Timestamp at(double s) {
  return Timestamp{duration_of(s)};
}

// A camera of 29.93 fps; its driver stamps `latency` after the frame, with jitter, and sometimes late.
struct Webcam {
  std::mt19937 random{7};
  double period_s = 1 / 29.93, latency_s = 0.03, jitter_s = 5e-4, late_s = 4e-3, late_share = 0.012, lost_share = 0.02;
  struct Sample {
    double true_s;  // the stamp without jitter
    Timestamp stamp;
  };
  std::vector<Sample> record(int frames) {
    std::vector<Sample> out;
    std::normal_distribution<double> jitter(0, jitter_s);
    std::uniform_real_distribution<double> chance;
    for (int k = 0; k < frames; ++k) {
      const double true_s = k * period_s + latency_s;
      const double stamp_s = true_s + jitter(random) + (chance(random) < late_share ? late_s : 0);
      if (chance(random) >= lost_share) out.push_back({true_s, at(stamp_s)});
    }
    return out;
  }
};

TEST(CameraClock, RegularStampsAreUnchanged) {
  CameraClock clock;
  for (int k = 0; k < 500; ++k) {
    const Timestamp stamp = at(k / 30.0);
    EXPECT_LE(std::chrono::abs(clock.smoothed(stamp) - stamp), 2ns) << k;
  }
  EXPECT_NEAR(clock.period_s().value(), 1 / 30.0, 1e-9);
}

TEST(CameraClock, SmoothsJitterAndLateStamps) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    Webcam webcam{.random = std::mt19937(seed)};
    CameraClock clock;
    double sum2 = 0, worst = 0;
    int count = 0;
    for (const auto& sample : webcam.record(600)) {
      const double error_s = seconds(clock.smoothed(sample.stamp)) - sample.true_s;
      if (++count <= 100) continue;
      sum2 += error_s * error_s;
      worst = std::max(worst, std::abs(error_s));
    }
    // The jitter's 0.5 ms over the root of the memory, twice for phase and period: 0.1 ms; a third more for late
    // stamps.
    EXPECT_LT(std::sqrt(sum2 / (count - 100)), 1.5e-4) << seed;
    EXPECT_LT(worst, 5e-4) << seed;
    EXPECT_LT(clock.sigma_s().value(), 1.5e-4);
  }
}

TEST(CameraClock, LostFramesShowAsWholePeriods) {
  CameraClock clock;
  for (int k = 0; k < 60; ++k) clock.smoothed(at(k / 25.0));
  EXPECT_NEAR(seconds(clock.smoothed(at(75 / 25.0 + 0.0004))), 75 / 25.0, 2e-4);
}

TEST(CameraClock, ChangeOfRateRestartsTheFit) {
  CameraClock clock;
  double t = 0;
  for (int k = 0; k < 100; ++k) clock.smoothed(at(t += 1 / 30.0));
  for (int k = 0; k < 10; ++k) t += 1 / 25.0, clock.smoothed(at(t));
  EXPECT_NEAR(seconds(clock.smoothed(at(t + 1 / 25.0))), t + 1 / 25.0, 1e-4);
  EXPECT_NEAR(clock.period_s().value(), 1 / 25.0, 1e-4);
}

TEST(CameraClock, IrregularStampsAreReturnedAsTheyAre) {
  std::mt19937 random(3);
  std::normal_distribution<double> wait(0.064, 0.012);
  CameraClock clock;
  double t = 0;
  for (int k = 0; k < 300; ++k) {
    t += std::max(0.02, wait(random));
    const double off_s = std::abs(seconds(clock.smoothed(at(t))) - t);
    if (k > 60) {
      EXPECT_LT(off_s, 1e-8) << k;
    }
  }
}

TEST(CameraClock, FollowsAClockStep) {
  CameraClock clock;
  for (int k = 0; k < 50; ++k) clock.smoothed(at(100 + k / 30.0));
  EXPECT_EQ(clock.smoothed(at(50)), at(50));
  EXPECT_EQ(clock.smoothed(at(4000)), at(4000));
  EXPECT_NEAR(seconds(clock.smoothed(at(4000 + 1 / 30.0))), 4000 + 1 / 30.0, 1e-9);
}

TEST(CameraClock, OutputAscendsWithTheStamps) {
  Webcam webcam{.jitter_s = 8e-3, .late_s = 0.02, .late_share = 0.2};
  CameraClock clock;
  Timestamp last_stamp{}, last{};
  for (const auto& sample : webcam.record(2000)) {
    if (sample.stamp <= last_stamp) continue;
    const Timestamp out = clock.smoothed(sample.stamp);
    if (last_stamp != Timestamp{}) {
      EXPECT_GT(out, last);
    }
    last = out, last_stamp = sample.stamp;
  }
}

}  // namespace
}  // namespace huetrack::capture
