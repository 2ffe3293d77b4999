// Another clock, another frame and another scale are distinguished.
#include "truth/alignment.h"

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

std::optional<Explanation> explained(const Truth& truth, const std::vector<Estimated>& estimates,
                                     const std::string& target = "ball") {
  const TargetTrack track{target, estimates};
  return explanation(truth, {&track, 1});
}

// Of a track with this error: turned about an axis of its own, moved, scaled.
std::vector<Estimated> moved(std::vector<Estimated> estimates, double angle_rad, const Eigen::Vector3d& by,
                             double scale = 1) {
  const Eigen::AngleAxisd turn(angle_rad, Eigen::Vector3d(1, 2, 3).normalized());
  for (Estimated& estimate : estimates) estimate.position = scale * (turn * estimate.position) + by;
  return estimates;
}

TEST_F(ClockOffsets, IsFoundIfItExplainsTheError) {
  const Truth truth = swinging(1);
  for (const double late_s : {0.012, -0.03, 0.2, 0.6}) {
    const auto found = explained(truth, track(1, late_s));
    ASSERT_TRUE(found) << late_s;
    EXPECT_EQ(found->by.freedom, Freedom::none);
    EXPECT_NEAR(found->by.offset_s, late_s, 1e-3);
    EXPECT_LT(found->by.rms_m, 0.011);
    EXPECT_GT(found->rms_m, 2 * found->by.rms_m);
    EXPECT_THAT(to_text(*found, {.clock_offset_s = 1}),
                testing::HasSubstr(fmt::format("--clock-offset {:.4f}", 1 + found->by.offset_s)));
  }
}

// The covariances do not matter: a wrong rig and a clock offset are both found where the estimates are overconfident.
TEST_F(ClockOffsets, AreNamedEvenIfTheEstimatesAreOverconfident) {
  const Truth truth = swinging(1);
  auto estimates = track(1, 0.03);
  for (Estimated& estimate : estimates) estimate.covariance *= 0.01;
  ASSERT_TRUE(explained(truth, estimates));
}

TEST_F(ClockOffsets, ExplainNeitherARightTrackNorAnUnknownTarget) {
  const Truth truth = swinging(1);
  EXPECT_FALSE(explained(truth, track(1, 0)));
  EXPECT_FALSE(explained(truth, track(1, 0.03), "other"));
  EXPECT_FALSE(explained(truth, {}));
  EXPECT_EQ(explained(swinging(0), track(0, 0.1, {0.02, 0, 0}))->by.aligns_time, false) << "at rest";
}

TEST_F(ClockOffsets, AnotherWorldFrameIsNamedWithItsTransform) {
  const auto found = explained(swinging(1), moved(track(1, 0), 0.3, {1, 2, 3}));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->by.freedom, Freedom::rigid);
  EXPECT_FALSE(found->by.aligns_time);
  EXPECT_NEAR(found->by.rms_m, 0.0085, 0.001);
  EXPECT_THAT(to_text(*found, {}),
              testing::AllOf(testing::HasSubstr("turns by 17."), testing::HasSubstr("--align rigid")));
}

TEST_F(ClockOffsets, AFrameAndAClockAreNamedTogether) {
  const auto found = explained(swinging(1), moved(track(1, 0.1), 3, {1, 2, 3}));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->by.freedom, Freedom::rigid);
  EXPECT_EQ(found->full.freedom, Freedom::rigid);
  EXPECT_NEAR(found->full.offset_s, 0.1, 2e-3);
  EXPECT_THAT(to_text(*found, {}), testing::HasSubstr("--align rigid --align-time"));
  EXPECT_THAT(to_text(*found, {.freedom = Freedom::similarity}), testing::HasSubstr("--align similarity --align-time"))
      << "what was given stays";
}

TEST_F(ClockOffsets, AScaleIsNamed) {
  const auto found = explained(swinging(1), moved(track(1, 0), 0.1, {1, 0, 0}, 1.25));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->full.freedom, Freedom::similarity);
  EXPECT_NEAR(found->full.scale, 1 / 1.25, 0.005);
  EXPECT_THAT(to_text(*found, {}), testing::HasSubstr("a scale of 0."));
  const auto in_millimetres = explained(swinging(1), moved(track(1, 0), 0, {1, 0, 0}, 1e-3));
  ASSERT_TRUE(in_millimetres);
  EXPECT_THAT(to_text(*in_millimetres, {}), testing::HasSubstr("the truth looks like millimetres"));
}

// A path that leaves every plane: in a plane a mirrored path is a turned one.
TEST_F(ClockOffsets, MirroredAxesAreNamed) {
  const auto out_of_plane = [](double t) { return Eigen::Vector3d(swing(t) + Eigen::Vector3d(0, 0, std::sin(2 * t))); };
  std::string y_negated = "t,ball,x,y,z\n", exchanged = y_negated;
  for (int i = 0; i <= 400; ++i) {
    const Eigen::Vector3d p = out_of_plane(0.01 * i);
    y_negated += fmt::format("{:.6f},ball,{:.9f},{:.9f},{:.9f}\n", 0.01 * i, p.x(), -p.y(), p.z());
    exchanged += fmt::format("{:.6f},ball,{:.9f},{:.9f},{:.9f}\n", 0.01 * i, p.x(), p.z(), p.y());
  }
  std::vector<Estimated> estimates = track(1, 0);
  for (Estimated& e : estimates)
    e.position = out_of_plane(std::chrono::duration<double>(e.at.time_since_epoch()).count());
  const auto negated = explained(truth(y_negated), estimates);
  ASSERT_TRUE(negated && negated->mirrored);
  EXPECT_EQ(negated->mirrored->axis, 1);
  EXPECT_THAT(to_text(*negated, {}), testing::AllOf(testing::HasSubstr("negate y in the truth"),
                                                    testing::HasSubstr("one world is left-handed")));
  const auto of_exchanged = explained(truth(exchanged), estimates);
  ASSERT_TRUE(of_exchanged && of_exchanged->mirrored);
  EXPECT_FALSE(of_exchanged->mirrored->axis);
  EXPECT_THAT(to_text(*of_exchanged, {}), testing::HasSubstr("or exchange two"));
  const auto turned = explained(swinging(1), moved(track(1, 0), 0.3, {1, 2, 3}));
  ASSERT_TRUE(turned);
  EXPECT_FALSE(turned->mirrored);
}

// What is left of the error where a clock offset explains most of it.
TEST_F(ClockOffsets, WhatIsLeftAfterAlignmentIsSaid) {
  const auto found = explained(swinging(1), moved(track(1, 0.05), 0.01, {0, 0, 0}));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->by.freedom, Freedom::none);
  EXPECT_LT(found->full.rms_m, found->by.rms_m);
  EXPECT_THAT(to_text(*found, {}), testing::ContainsRegex("leave [89]\\.[0-9] mm \\(--align rigid --align-time\\)"));
}

TEST_F(ClockOffsets, AnAlignedTrackHasTheErrorThatIsSaid) {
  const Truth truth = swinging(1);
  const auto estimates = moved(track(1, 0.1), 2, {1, 2, 3}, 0.8);
  const TargetTrack of{"ball", estimates};
  const auto alignment = align(truth, {&of, 1}, Freedom::similarity, true);
  ASSERT_TRUE(alignment);
  double squares = 0, nees_sum = 0;
  for (const Estimated& estimate : estimates) {
    const Estimated aligned = alignment->aligned(estimate);
    const Eigen::Vector3d error = aligned.position - *truth.position("ball", aligned.at);
    squares += error.squaredNorm();
    nees_sum += nees(error, aligned.covariance);
  }
  EXPECT_NEAR(std::sqrt(squares / double(estimates.size())), alignment->rms_m, 1e-6);
  EXPECT_NEAR(nees_sum / double(estimates.size()), 3 / (1.25 * 1.25) * 1, 3);
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
