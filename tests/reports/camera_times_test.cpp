#include "reports/camera_times.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "calib/model/rig_yaml.h"
#include "scene/scene.h"

namespace huetrack::reports {
namespace {

namespace fs = std::filesystem;
using object_tracking::CameraTimingEstimate;
using object_tracking::ObjectEstimate;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

config::ServiceConfig two_cameras() {
  config::ServiceConfig config;
  config.rig = scene::SceneBuilder{}.cameras_on_ring({.count = 2}).build().rig;
  return config;
}

ObjectEstimate target_at(double speed_m_s, std::vector<CameraTimingEstimate> times) {
  ObjectEstimate e;
  e.state = object_tracking::TrackState::tracking;
  e.position = e.velocity = Eigen::Vector3d::Zero();
  e.velocity.x() = speed_m_s;
  e.times = std::move(times);
  return e;
}

void take(CameraTimes& times, std::vector<ObjectEstimate> estimates, const capture::FrameSet& frames = {}) {
  times.on_set({.frames = frames, .estimates = estimates, .received_at = {}, .trackers = {}, .reloaded = {}});
}

const CameraTimingEstimate reference{.readout_s = 0.025, .readout_sigma_s = 0.001};
const CameraTimingEstimate open{.latency_s = 0.010, .latency_sigma_s = 0.015, .readout_sigma_s = 0.02};
const CameraTimingEstimate known{
    .latency_s = 0.012, .latency_sigma_s = 3e-4, .readout_s = 0.03, .readout_sigma_s = 1e-3};

TEST(CameraTimes, WarnsOnlyWhileSomethingMovesAndLatencyIsUnknown) {
  CameraTimes times(two_cameras(), {}, false);
  EXPECT_THAT(times.timing(), IsEmpty());
  take(times, {target_at(0.1, {reference, open})});
  EXPECT_THAT(times.warnings(), IsEmpty());
  take(times, {target_at(1, {reference, open})});
  EXPECT_THAT(times.warnings(), ElementsAre(HasSubstr("not known yet of cam1 (+- 15 ms)")));
  take(times, {target_at(1, {reference, known})});
  EXPECT_THAT(times.warnings(), IsEmpty());
  take(times, {target_at(1, {reference, open})});
  config::ServiceConfig fixed = two_cameras();
  fixed.object_tracking.timing = object_tracking::TimingMode::fixed;
  times.on_config(fixed);
  EXPECT_THAT(times.warnings(), IsEmpty());
}

TEST(CameraTimes, UsesTheMostCertainTarget) {
  CameraTimes times(two_cameras(), {}, false);
  take(times, {target_at(1, {reference, open}), target_at(1, {reference, known})});
  ASSERT_EQ(times.timing().size(), 2u);
  EXPECT_EQ(times.timing()[1].latency_s, known.latency_s);
  EXPECT_THAT(times.summary(), ElementsAre(HasSubstr("cam0: latency 0.0 ms (reference"),
                                           HasSubstr("cam1: latency 12.0 ms +- 0.3, readout 30.0 ms +- 1.0")));
}

TEST(CameraTimes, WritesKnownTimingIntoANewRigFile) {
  const fs::path file = fs::path(testing::TempDir()) / "camera_times_test_rig.yaml";
  fs::remove(file);
  {
    CameraTimes times(two_cameras(), file, false);
    take(times, {target_at(1, {reference, open})});
    EXPECT_FALSE(times.rig().cameras[1].timing.latency_s);
    take(times, {target_at(1, {reference, known})});
    times.flush();
  }
  EXPECT_NEAR(calib::read_rig(file).cameras[1].timing.latency_s.value(), 0.012, 1e-9);
  EXPECT_THROW(CameraTimes(two_cameras(), file, false), std::runtime_error);  // nothing is overwritten
  fs::remove(file);
}

// Frames that were dropped and not counted: what the filter has learnt is of a part of the film.
TEST(CameraTimes, UnevenStampsMakeTheLatencyUncertain) {
  CameraTimes times(two_cameras(), {}, false);
  const std::vector<std::vector<view_watch::Mistake>> mistakes{
      {{.kind = view_watch::MistakeKind::uneven_times, .cameras = {1}, .size = 0.1}}};
  std::vector<ObjectEstimate> estimates{target_at(1, {reference, known})};
  const capture::FrameSet frames;
  times.on_set({.frames = frames,
                .estimates = estimates,
                .received_at = {},
                .trackers = {},
                .mistakes = mistakes,
                .reloaded = {}});
  take(times, {target_at(1, {reference, known})});
  EXPECT_THAT(times.summary(), ElementsAre(HasSubstr("cam0: latency 0.0 ms"),
                                           AllOf(HasSubstr("cam1: latency 12.0 ms +- 100.0"), HasSubstr("uneven"))));
  EXPECT_FALSE(times.rig().cameras[1].timing.latency_s);
}

// Wrong poses, for example: the filter is sure of a readout that no camera of 30 frames a second has.
TEST(CameraTimes, AReadoutLongerThanTheFramePeriodIsNotKnown) {
  using namespace std::chrono_literals;
  CameraTimes times(two_cameras(), {}, false);
  const CameraTimingEstimate impossible{
      .latency_s = 0.012, .latency_sigma_s = 3e-4, .readout_s = -0.0637, .readout_sigma_s = 1e-3};
  capture::FrameSet set;
  set.frames.resize(2);
  for (int k = 0; k < 150; ++k) {
    set.frames[0].emplace().captured_at = set.frames[1].emplace().captured_at = capture::Timestamp(33333us * k);
    take(times, {target_at(1, {reference, impossible})}, set);
  }
  EXPECT_THAT(times.warnings(), ElementsAre(HasSubstr("not known yet of cam1 (+- 30 ms)")));
  EXPECT_THAT(times.summary()[1], AllOf(HasSubstr("readout -63.7 ms +- 30.4"), HasSubstr("not known yet")));
  EXPECT_NEAR(times.timing()[1].readout_sigma_s, 0.0304, 1e-4);
  EXPECT_EQ(times.timing()[0].readout_sigma_s, reference.readout_sigma_s);
  EXPECT_FALSE(times.rig().cameras[1].timing.readout_s);
  EXPECT_TRUE(times.rig().cameras[0].timing.readout_s);
}

// Regression: unused timing was written to the rig as exactly 0.
TEST(CameraTimes, FixedTimingIsNotLearntAndNotWritten) {
  config::ServiceConfig fixed = two_cameras();
  fixed.object_tracking.timing = object_tracking::TimingMode::fixed;
  fixed.rig.cameras[1].timing = {
      .latency_s = 0.02, .latency_sigma_s = 1e-3, .readout_s = 0.03, .readout_sigma_s = 2e-3};
  CameraTimes times(fixed, {}, false);
  take(times, {target_at(1, {{}, {.latency_s = 0.02, .readout_s = 0.03}})});
  EXPECT_FALSE(times.rig().cameras[0].timing.latency_s);
  EXPECT_EQ(times.rig().cameras[1].timing.latency_sigma_s, 1e-3);
  EXPECT_THAT(times.summary(),
              ElementsAre("cam0: latency 0.0 ms, readout 0.0 ms (timing: fixed; 0 because the rig has none)",
                          "cam1: latency 20.0 ms, readout 30.0 ms (timing: fixed)"));
}

}  // namespace
}  // namespace huetrack::reports
