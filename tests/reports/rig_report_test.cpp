#include "reports/rig_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scene/scene.h"

namespace huetrack::reports {
namespace {

using room_watch::RoomState;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

config::ServiceConfig watched_cameras() {
  config::ServiceConfig config;
  config.rig = scene::SceneBuilder{}.cameras_on_ring({.count = 2}).build().rig;
  config.calibration.watch = config::CalibrationMode::mend;
  return config;
}

constexpr double sigma_m = 0.003;

// Sets of three seconds, from from_ms on, in which the second camera is in this state.
void take(RigReport& report, const config::ServiceConfig& config, RoomState state, int from_ms = 0) {
  std::vector<pipeline::CameraCalibration> facts(2);
  facts[1].room.state = state;
  facts[1].room.since = capture::Timestamp(std::chrono::milliseconds(from_ms));
  if (state == RoomState::defocused) facts[1].room.blur_px = 2.1;
  if (state == RoomState::changed) facts[1].room.change = {.patches = 5, .share = 0.12, .middle = {0.2, 0.5}};
  if (state == RoomState::knocked) {
    room_watch::MovedPoseEstimate moved{.cam_from_world = config.rig.cameras[1].cam_from_world,
                                        .covariance = Eigen::Matrix<double, 6, 6>::Identity() * sigma_m * sigma_m,
                                        .rotation = {0.02, 0, 0},
                                        .shift = {0, 0.001, 0},
                                        .rotation_sigma = sigma_m,
                                        .shift_sigma = sigma_m};
    moved.cam_from_world.translation.y() += 0.001;
    facts[1].moved = moved;
  }
  for (int k = 0; k < 90; ++k) {
    capture::FrameSet frames;
    frames.at = capture::Timestamp(std::chrono::milliseconds(from_ms + 33 * (k + 1)));
    report.on_set({.frames = frames, .estimates = {}, .received_at = {}, .trackers = {}, .calibration = facts});
  }
}

TEST(RigReport, AMovedCameraIsTrouble) {
  const config::ServiceConfig config = watched_cameras();
  RigReport report(config);
  EXPECT_FALSE(report.has_had_trouble());
  take(report, config, RoomState::knocked);
  EXPECT_TRUE(report.has_had_trouble());
  EXPECT_THAT(report.summary(), SizeIs(1));
}

// Even after it recovered: it contributed nothing meanwhile.
TEST(RigReport, ABlindCameraIsTrouble) {
  for (const RoomState state : {RoomState::hidden, RoomState::blinded}) {
    const config::ServiceConfig config = watched_cameras();
    RigReport report(config);
    take(report, config, state);
    take(report, config, RoomState::still);
    EXPECT_TRUE(report.has_had_trouble()) << room_watch::name(state);
    EXPECT_THAT(report.summary(), SizeIs(1));
  }
}

// An event's report must not get the times of a later event of the same kind.
TEST(RigReport, EachEventKeepsItsOwnTime) {
  const config::ServiceConfig config = watched_cameras();
  RigReport report(config);
  take(report, config, RoomState::hidden, 1000);
  take(report, config, RoomState::still, 4000);
  take(report, config, RoomState::hidden, 7000);
  take(report, config, RoomState::moving, 10000);
  take(report, config, RoomState::hidden, 13000);
  EXPECT_THAT(report.summary(), ElementsAre(AllOf(HasSubstr("reported at 1.03 s"), HasSubstr("since 1.00 s")),
                                            AllOf(HasSubstr("reported at 7.03 s"), HasSubstr("since 7.00 s"))));
}

TEST(RigReport, AFocusChangeIsReportedOnceWithItsBlurAndIsTrouble) {
  const config::ServiceConfig config = watched_cameras();
  RigReport report(config);
  take(report, config, RoomState::defocused);
  take(report, config, RoomState::defocused);
  EXPECT_TRUE(report.has_had_trouble());
  EXPECT_THAT(report.summary(), ElementsAre(AllOf(HasSubstr("cam1's focus has changed"), HasSubstr("by 2.1 px more"))));
  EXPECT_THAT(report.warnings(), SizeIs(1));
  take(report, config, RoomState::still);
  EXPECT_THAT(report.warnings(), testing::IsEmpty());
}

TEST(RigReport, AChangedRoomIsReportedAndIsNoTrouble) {
  const config::ServiceConfig config = watched_cameras();
  RigReport report(config);
  take(report, config, RoomState::changed);
  EXPECT_FALSE(report.has_had_trouble());
  EXPECT_FALSE(is_trouble(report.cameras()[1].room.state));
  EXPECT_THAT(report.summary(), ElementsAre(HasSubstr("changed in cam1's view (about 12 % of it, at the left)")));
  EXPECT_THAT(report.warnings(), SizeIs(1));
}

// Even if the rig had no uncertainty before.
TEST(RigReport, ACorrectedPoseHasItsUncertainty) {
  const config::ServiceConfig config = watched_cameras();
  RigReport report(config);
  take(report, config, RoomState::knocked);
  calib::CameraRig rig = config.rig;
  ASSERT_FALSE(rig.uncertainty);
  ASSERT_EQ(report.mend(rig), 1);
  EXPECT_NE(rig.cameras[1].cam_from_world.translation, config.rig.cameras[1].cam_from_world.translation);
  ASSERT_TRUE(rig.uncertainty);
  EXPECT_FALSE(rig.uncertainty->cameras[0].has_pose);
  ASSERT_TRUE(rig.uncertainty->cameras[1].has_pose);
  EXPECT_NEAR(rig.uncertainty->covariance()(0, 0), sigma_m * sigma_m, 1e-9);
  EXPECT_THAT(rig.problems(), testing::IsEmpty());
}

}  // namespace
}  // namespace huetrack::reports
