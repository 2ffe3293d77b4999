#include "daemon/status_reporter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

namespace huetrack::daemon {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

class Reporter : public testing::Test {
 protected:
  const config::ServiceConfig config_ =
      config::load_service_config(std::filesystem::path(HUETRACK_SOURCE_DIR) / "configs/demo/huetrackd.yaml");
  StatusReporter reporter_{config_, "replay", 250ms};
  const Clock::time_point start_ = Clock::now();
  pipeline::PipelineFigures figures_ = [] {
    pipeline::PipelineFigures figures;
    figures.cameras.resize(2);
    return figures;
  }();
};

TEST_F(Reporter, HasTheIdentityOfTheProcess) {
  const publish::ServiceStatus status = reporter_.report(figures_, start_, capture::Timestamp(7s));
  EXPECT_EQ(status.at, capture::Timestamp(7s));
  EXPECT_EQ(status.mode, "replay");
  EXPECT_EQ(status.program_version, HUETRACK_VERSION);
  EXPECT_EQ(status.config_identity, config::config_identity(config_));
  EXPECT_EQ(status.rig_identity.size(), 16u);
  EXPECT_DOUBLE_EQ(status.clock_offset_s, 0.25);
  EXPECT_THAT(status.targets, testing::ElementsAre("lime"));
  ASSERT_EQ(status.cameras.size(), 2u);
  EXPECT_EQ(status.cameras[1].name, "cam1");
}

// At the time of the report: a service that runs for days has a rig that grows older.
TEST_F(Reporter, HasTheAgeOfTheRig) {
  config::ServiceConfig config = config_;
  config.rig.made.at = calib::UtcTime(0s);
  config.rig.made.checks = {{calib::UtcTime(48h), "usable", ""}};
  StatusReporter reporter(config, "run", {});
  EXPECT_EQ(reporter.report(figures_, start_, capture::Timestamp(72h)).rig_history,
            "calibrated 3 days ago; last checked 24 hours ago: usable");
  EXPECT_EQ(reporter.report(figures_, start_ + 1h, capture::Timestamp(24h * 5)).rig_history.substr(0, 21),
            "calibrated 5 days ago");
  EXPECT_EQ(reporter_.report(figures_, start_, capture::Timestamp(72h)).rig_history, "") << "its file has no date";
}

TEST_F(Reporter, HealthFollowsTheFrames) {
  figures_.cameras[0].frames = 1;
  figures_.cameras[0].last_received = start_;
  const auto early = reporter_.report(figures_, start_ + 100ms, {});
  EXPECT_EQ(early.cameras[0].health, publish::CameraStatus::Health::delivering);
  EXPECT_EQ(early.cameras[1].health, publish::CameraStatus::Health::waiting);
  EXPECT_EQ(early.cameras[1].message, "no frame yet");
  const auto late = reporter_.report(figures_, start_ + 2500ms, {});
  EXPECT_EQ(late.cameras[0].health, publish::CameraStatus::Health::stalled);
  EXPECT_EQ(late.cameras[0].message, "no frame for 2.5 s");
  EXPECT_NEAR(late.cameras[0].age_s, 2.5, 1e-9);
  figures_.cameras[0].ended = true;
  EXPECT_EQ(reporter_.report(figures_, start_ + 3s, {}).cameras[0].health, publish::CameraStatus::Health::ended);
}

TEST_F(Reporter, WarnsWhileSetsAreDropped) {
  const auto dropped = testing::Contains(testing::HasSubstr("of the frame sets are dropped"));
  reporter_.report(figures_, start_, {});
  figures_.sets_tracked = 29, figures_.sets_dropped = 1;
  EXPECT_THAT(reporter_.report(figures_, start_ + 1s, {}).warnings, testing::Not(dropped)) << "one in thirty";
  figures_.sets_tracked = 49, figures_.sets_dropped = 11;
  EXPECT_THAT(reporter_.report(figures_, start_ + 2s, {}).warnings,
              testing::Contains(testing::HasSubstr("33 % of the frame sets are dropped")));
  figures_.sets_tracked = 79;
  EXPECT_THAT(reporter_.report(figures_, start_ + 3s, {}).warnings, testing::Not(dropped)) << "over";
}

TEST_F(Reporter, RatesContinueAfterAReload) {
  reporter_.report(figures_, start_, {});
  figures_.sets_tracked = 25;
  config::ServiceConfig other = config_;
  other.targets[0].radius_m *= 2;
  reporter_.take_over(other);
  const publish::ServiceStatus status = reporter_.report(figures_, start_ + 1s, {});
  EXPECT_NEAR(status.set_rate_hz, 25, 1e-6);
  EXPECT_EQ(status.config_identity, config::config_identity(other));
  EXPECT_EQ(status.mode, "replay");
  EXPECT_DOUBLE_EQ(status.clock_offset_s, 0.25);
}

TEST_F(Reporter, RatesAreOverTheTimeSinceAnEarlierReport) {
  reporter_.report(figures_, start_, {});
  figures_.sets_tracked = 25;
  figures_.cameras[0].frames = 30;
  figures_.cameras[0].last_received = start_ + 1s;
  auto status = reporter_.report(figures_, start_ + 1s, {});
  EXPECT_NEAR(status.set_rate_hz, 25, 1e-9);
  EXPECT_NEAR(status.cameras[0].rate_hz, 30, 1e-9);
  // A report right behind another has the same long window, not one of a millisecond.
  status = reporter_.report(figures_, start_ + 1001ms, {});
  EXPECT_NEAR(status.set_rate_hz, 25, 0.1);
}

TEST_F(Reporter, ManyDamagedFramesAreAWarning) {
  capture::CameraHealth well, ill;
  well.state = ill.state = capture::CaptureState::delivering;
  ill.warning = "31 % of its frames are damaged";
  const std::vector<std::optional<capture::CameraHealth>> live{well, ill};
  EXPECT_THAT(reporter_.report(figures_, start_, {}, live).warnings,
              testing::Contains("camera cam1: 31 % of its frames are damaged"));
}

TEST_F(Reporter, ACameraThatRepeatsItsLastPictureIsStalled) {
  pipeline::CameraFigures& camera = figures_.cameras[0];
  camera.frames = 1000;
  camera.repeated = 60;
  camera.times_repeated = 1;
  camera.last_received = start_;
  camera.last_captured = capture::Timestamp(33s);
  camera.repeated_since = capture::Timestamp(31s);
  const auto hangs = reporter_.report(figures_, start_, {});
  EXPECT_EQ(hangs.cameras[0].health, publish::CameraStatus::Health::stalled);
  EXPECT_THAT(hangs.cameras[0].message, testing::HasSubstr("it has repeated one picture for 2.0 s"));
  capture::CameraHealth live;
  live.state = capture::CaptureState::delivering;
  const std::vector<std::optional<capture::CameraHealth>> both{live, live};
  EXPECT_EQ(reporter_.report(figures_, start_, {}, both).cameras[0].health, publish::CameraStatus::Health::stalled);
  camera.repeated_since.reset();
  const auto well = reporter_.report(figures_, start_, {});
  EXPECT_EQ(well.cameras[0].health, publish::CameraStatus::Health::delivering);
  EXPECT_THAT(well.warnings, testing::Not(testing::Contains(testing::HasSubstr("more than once"))));
}

TEST_F(Reporter, RepeatedFramesAreAWarning) {
  figures_.cameras[1].frames = 1000;
  figures_.cameras[1].repeated = figures_.cameras[1].times_repeated = 480;
  figures_.cameras[1].last_received = start_;
  const auto is_reported = testing::Contains(testing::HasSubstr("cam1: it repeats its pictures: 480 of its 1000"));
  EXPECT_THAT(reporter_.report(figures_, start_, {}).warnings, is_reported);
  // A second later it shows each once: what was is told no more.
  figures_.cameras[1].frames = 1030;
  EXPECT_THAT(reporter_.report(figures_, start_ + 1s, {}).warnings, testing::Not(is_reported));
}

TEST_F(Reporter, ACameraThatRepeatsItsFirstPictureIsAWarning) {
  const auto is_reported = testing::Contains(testing::HasSubstr("cam1: it has repeated one picture since"));
  figures_.cameras[1].last_received = start_;
  figures_.cameras[1].has_changed = false;
  figures_.cameras[1].frames = 20;
  EXPECT_THAT(reporter_.report(figures_, start_, {}).warnings, testing::Not(is_reported));
  figures_.cameras[1].frames = 200;
  EXPECT_THAT(reporter_.report(figures_, start_, {}).warnings, is_reported);
  figures_.cameras[1].has_changed = true;
  EXPECT_THAT(reporter_.report(figures_, start_, {}).warnings, testing::Not(is_reported));
}

TEST_F(Reporter, CountersAreCopied) {
  figures_.frame_sets.incomplete_sets = 3;
  figures_.frame_sets.late_frames = 4;
  figures_.sets_dropped = 5;
  figures_.sets_tracked = 6;
  figures_.cameras[1].dropped = 7;
  figures_.cameras[1].corrupted = 8;
  figures_.cameras[1].repeated = 9;
  const auto status = reporter_.report(figures_, start_, {});
  EXPECT_EQ(status.incomplete_sets, 3u);
  EXPECT_EQ(status.late_frames, 4u);
  EXPECT_EQ(status.dropped_sets, 5u);
  EXPECT_EQ(status.sets, 6u);
  EXPECT_EQ(status.cameras[1].dropped, 7u);
  EXPECT_EQ(status.cameras[1].corrupted, 8u);
  EXPECT_EQ(status.cameras[1].repeated, 9u);
}

TEST_F(Reporter, WarnsOfATrackedCameraWithoutAPose) {
  config::ServiceConfig config = config_;
  config.camera_tracking.camera = "cam0";
  figures_.tracked_camera.at = capture::Timestamp(9s);
  figures_.tracked_camera.without_since = capture::Timestamp(0s);
  figures_.tracked_camera.why = "frame 9 is grey";
  const auto status = StatusReporter(config, "run", {}).report(figures_, start_, {});
  EXPECT_THAT(status.warnings, testing::Contains("camera cam0: no pose for 9 s (searching): frame 9 is grey"));
  figures_.tracked_camera.without_since.reset();
  const auto fine = StatusReporter(config, "run", {}).report(figures_, start_, {});
  EXPECT_THAT(fine.warnings, testing::Not(testing::Contains(testing::HasSubstr("no pose"))));
}

TEST_F(Reporter, ClocksOfRemoteHostsAreReportedOncePerHost) {
  capture::CameraHealth health;
  health.state = capture::CaptureState::delivering;
  health.clock = capture::HostClock{
      .host = "pi-3", .is_known = true, .offset_s = 0.04, .sigma_s = 2e-3, .kept_s = std::nullopt, .advice = "a cable"};
  const std::vector<std::optional<capture::CameraHealth>> live{health, health};
  const auto status = reporter_.report(figures_, start_, {}, live);
  ASSERT_EQ(status.clocks.size(), 1u);
  EXPECT_EQ(status.clocks[0].clock.host, "pi-3");
  EXPECT_DOUBLE_EQ(status.clocks[0].clock.sigma_s, 2e-3);
  EXPECT_THAT(status.clocks[0].cameras, testing::ElementsAre("cam0", "cam1"));
  EXPECT_EQ(std::ranges::count(status.warnings, "a cable"), 1);
}

}  // namespace
}  // namespace huetrack::daemon
