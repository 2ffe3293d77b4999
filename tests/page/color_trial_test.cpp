#include "page/color_trial.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

namespace huetrack::page {
namespace {

using namespace testing;

const std::filesystem::path demo = std::filesystem::path(HUETRACK_SOURCE_DIR) / "configs/demo";

// The demo's ball, by hues from `least` on, held to what was seen at a pixel of cam0's 61st frame, where it is at
// 219.07, 159.23 (groundtruth.csv).
ColorTrial trial_of(double least_hue, const Eigen::Vector2d& px) {
  const config::ServiceConfig config = config::load_service_config(demo / "huetrackd.yaml");
  object_tracking::TargetOptions target = config.targets.at(0);
  target.color.hue_min_deg = least_hue, target.color.hue_max_deg = least_hue + 50;
  const std::vector<std::string> words{(demo / "recording").string()};
  return try_color(config, words, target, {.point = {0, px}, .at = capture::Timestamp(std::chrono::seconds(2))}, {});
}

TEST(ColorTrial, FindsTheObjectAtThePoint) {
  const ColorTrial trial = trial_of(65, {219, 159});
  EXPECT_EQ(trial.sets, 150u);
  EXPECT_GT(trial.tracking, 140u);
  EXPECT_LT(trial.sigma_m, 0.01);
  ASSERT_TRUE(trial.is_found());
  EXPECT_LT(trial.at_point->px, 1.5);
  EXPECT_THAT(
      words_of(trial, "left"),
      MatchesRegex(
          "tried on the recording, it is `tracking` in 1[0-9]+ of 150 sets, "
          "with a sigma of [0-9.]+ mm by the pictures, and in every tenth over [0-9.]+, [0-9.]+ px from the point in "
          "left"));
}

TEST(ColorTrial, RejectsAnotherObject) {
  const ColorTrial trial = trial_of(65, {60, 60});
  ASSERT_TRUE(trial.at_point);
  EXPECT_FALSE(trial.is_found());
  EXPECT_NEAR(trial.at_point->px, std::hypot(159.07, 99.23), 1.5);
  EXPECT_THAT(words_of(trial, "left"), ContainsRegex("but 18[78] px away from the point in left"));
}

TEST(ColorTrial, AnUnseenColourTracksNothing) {
  const ColorTrial trial = trial_of(180, {219, 159});
  EXPECT_EQ(trial.tracking, 0u);
  EXPECT_FALSE(trial.at_point);
  EXPECT_EQ(words_of(trial, "left"), "tried on the recording, nothing is tracked in any of 150 sets");
}

// The distance of the only camera's object is open to some per cent, which is more than its radius.
TEST(ColorTrial, TheOnlyCameraIsSure) {
  config::ServiceConfig config = config::load_service_config(demo / "huetrackd.yaml");
  config.rig.cameras.resize(1);
  const std::vector<std::string> words{(demo / "recording").string()};
  const object_tracking::TargetOptions& target = config.targets.at(0);
  const SeenAt seen{.point = {0, {219, 159}}, .at = capture::Timestamp(std::chrono::seconds(2))};
  const ColorTrial trial = try_color(config, words, target, seen, {});
  EXPECT_GT(3 * trial.sigma_m, target.radius_m);
  EXPECT_TRUE(trial.is_found());
  EXPECT_TRUE(trial.is_sure) << words_of(trial, "cam0");
}

// As `huetrackd setup` writes it: all directions are as uncertain as the assumed lens, tens of pixels off its middle.
TEST(ColorTrial, TheUncertainLensOfTheOnlyCameraIsNoDoubtOfTheColour) {
  config::ServiceConfig config = config::load_service_config(demo / "huetrackd.yaml");
  config.rig.cameras.resize(1);
  const auto& lens = config.rig.cameras[0].model;
  const int parameters = calib::is_lens_count(lens, 8) ? 8 : 12;
  Eigen::VectorXd sigma = Eigen::VectorXd::Constant(parameters, 1e-9);
  sigma.head<2>().setConstant(0.25 * 300);
  config.rig.uncertainty = calib::RigUncertainty::of({{.lens_count = parameters}}, sigma.cwiseAbs2().asDiagonal());
  const std::vector<std::string> words{(demo / "recording").string()};
  const SeenAt seen{.point = {0, {219, 159}}, .at = capture::Timestamp(std::chrono::seconds(2))};
  const ColorTrial trial = try_color(config, words, config.targets.at(0), seen, {});
  EXPECT_TRUE(trial.is_found());
  EXPECT_TRUE(trial.is_sure) << words_of(trial, "cam0");
  const SeenAt elsewhere{.point = {0, {60, 60}}, .at = seen.at};
  EXPECT_FALSE(try_color(config, words, config.targets.at(0), elsewhere, {}).is_found());
}

TEST(ColorTrial, EndsOnAStop) {
  std::stop_source stop;
  stop.request_stop();
  const config::ServiceConfig config = config::load_service_config(demo / "huetrackd.yaml");
  const std::vector<std::string> words{(demo / "recording").string()};
  EXPECT_LT(try_color(config, words, config.targets.at(0), {}, stop.get_token()).sets, 150u);
}

}  // namespace
}  // namespace huetrack::page
