// Distinguishes a track on another clock from a wrong one.
#include "truth/clock_offset.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "truth/truth_file.h"

namespace huetrack::truth {
namespace {

// To and fro at 1 m/s and more, which no shift in space imitates.
Eigen::Vector3d swing(double t) {
  return {std::sin(3 * t), 0.5 * std::cos(5 * t), 1};
}

class ClockOffsets : public TruthFile {
 protected:
  Truth swinging(double speed) const {
    std::string text = "t,ball,x,y,z\n";
    for (int i = 0; i <= 400; ++i) {
      const Eigen::Vector3d p = swing(speed * 0.01 * i);
      text += fmt::format("{:.6f},ball,{:.9f},{:.9f},{:.9f}\n", 0.01 * i, p.x(), p.y(), p.z());
    }
    return truth(text);
  }
};

// A sigma of 5 mm, which is true.
std::vector<Estimated> track(double speed, double late_s, const Eigen::Vector3d& off = {0, 0, 0}) {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 0.005);
  std::vector<Estimated> estimates;
  for (int i = 20; i < 100; ++i) {
    const double t = i / 30.0;
    const Eigen::Vector3d error(noise(random), noise(random), noise(random));
    estimates.push_back({Timestamp(std::chrono::round<std::chrono::nanoseconds>(std::chrono::duration<double>(t))),
                         swing(speed * (t - late_s)) + error + off, 25e-6 * Eigen::Matrix3d::Identity()});
  }
  return estimates;
}

TEST_F(ClockOffsets, IsFoundIfItExplainsTheError) {
  const Truth truth = swinging(1);
  for (const double late_s : {0.012, -0.03, 0.2}) {
    const auto offset = explaining_offset(truth, "ball", track(1, late_s));
    ASSERT_TRUE(offset) << late_s;
    EXPECT_NEAR(offset->offset_s, late_s, 1e-3);
    EXPECT_NEAR(offset->mean_nees, 3, 1);
    EXPECT_LT(offset->rms_m, 0.011);
    EXPECT_GT(offset->rms_without_m, 2 * offset->rms_m);
  }
}

TEST_F(ClockOffsets, ExplainsNeitherARightTrackNorAWrongOne) {
  const Truth truth = swinging(1);
  EXPECT_EQ(explaining_offset(truth, "ball", track(1, 0)), std::nullopt);
  EXPECT_EQ(explaining_offset(truth, "ball", track(1, 0.012, {0, 0, 0.05})), std::nullopt);      // off to the side, too
  EXPECT_EQ(explaining_offset(swinging(0), "ball", track(0, 0.1, {0.02, 0, 0})), std::nullopt);  // at rest
  EXPECT_EQ(explaining_offset(truth, "other", track(1, 0.03)), std::nullopt);
  EXPECT_EQ(explaining_offset(truth, "ball", std::vector<Estimated>()), std::nullopt);
}

TEST(EstimatedSample, IsSpreadOverTheTrack) {
  EstimatedSample sample;
  for (int i = 0; i < 100'000; ++i) sample.add({Timestamp(std::chrono::milliseconds(i)), {}, {}});
  EXPECT_LT(sample.kept().size(), 4001u);
  EXPECT_GT(sample.kept().size(), 1900u);
  EXPECT_EQ(sample.kept().front().at, Timestamp());
  EXPECT_GT(sample.kept().back().at, Timestamp(std::chrono::milliseconds(99'000)));
  const auto step = sample.kept()[1].at - sample.kept()[0].at;
  for (std::size_t i = 1; i < sample.kept().size(); ++i)
    ASSERT_EQ(sample.kept()[i].at - sample.kept()[i - 1].at, step) << i;
}

}  // namespace
}  // namespace huetrack::truth
