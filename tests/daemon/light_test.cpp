// What is said of light: by doctor, and by a replay whose cameras' colours wander.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <numbers>

#include "calib/model/rig_yaml.h"
#include "daemon/replay.h"
#include "doctor/light_exam.h"
#include "object_tracking/trackers/color_follower.h"
#include "recordings/recording_writer.h"
#include "reports/light_words.h"
#include "scene/scene.h"
#include "scene/turned_hue.h"

namespace huetrack::daemon {
namespace {

namespace fs = std::filesystem;
using doctor::CameraExam;
using doctor::Finding;
using doctor::judge_light;
using doctor::LightExam;
using object_tracking::TrackState;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

auto says(doctor::Grade verdict, const std::string& what, const std::string& advice = "") {
  return Contains(AllOf(Field(&Finding::verdict, verdict), Field(&Finding::what, HasSubstr(what)),
                        Field(&Finding::advice, HasSubstr(advice))));
}

CameraExam exam_with(const std::vector<std::pair<std::string, std::int64_t>>& controls) {
  CameraExam exam;
  exam.name = "left";
  for (const auto& [name, value] : controls) {
    capture::Control control;
    control.name = name;
    control.value = value;
    exam.controls.push_back(control);
  }
  return exam;
}

TEST(JudgeLight, ExposuresOfWholeFlickerPeriodsAreFine) {
  for (const std::int64_t time : {100, 200, 300, 83, 167})
    EXPECT_THAT(judge_light(exam_with({{"auto_exposure", 1}, {"exposure_time_absolute", time}})), IsEmpty()) << time;
  for (const std::int64_t time : {128, 50, 156})
    EXPECT_THAT(judge_light(exam_with({{"auto_exposure", 1}, {"exposure_time_absolute", time}})),
                says(doctor::Grade::note, "show the flicker of lamps", "100, 200 or 300"))
        << time;
  // Where the camera is told which mains there are, only theirs count; an automatic exposure sees to it itself.
  EXPECT_THAT(
      judge_light(exam_with({{"auto_exposure", 1}, {"exposure_time_absolute", 83}, {"power_line_frequency", 1}})),
      says(doctor::Grade::note, "exposures of 8.3 ms"));
  EXPECT_THAT(judge_light(exam_with({{"auto_exposure", 3}, {"exposure_time_absolute", 128}})), IsEmpty());
}

TEST(JudgeLight, AutomaticControlsAreNamed) {
  const auto findings = judge_light(exam_with({{"exposure_dynamic_framerate", 1}, {"power_line_frequency", 0}}));
  EXPECT_THAT(findings,
              says(doctor::Grade::warning, "exposure_dynamic_framerate is on", "exposure_dynamic_framerate: 0"));
  EXPECT_THAT(findings, says(doctor::Grade::note, "power_line_frequency is off", "50 Hz"));
  CameraExam set = exam_with({{"exposure_dynamic_framerate", 1}});
  set.configured = {{"exposure_dynamic_framerate", "0", 0, "", false}};
  EXPECT_THAT(judge_light(set), IsEmpty());
}

TEST(JudgeLight, FindingsInPicturesAreNamed) {
  CameraExam exam = exam_with({{"auto_exposure", 1}});
  exam.trial.emplace();
  EXPECT_THAT(judge_light(exam), IsEmpty());  // too few frames to say anything
  exam.trial->light = capture::LightFindings{};
  EXPECT_THAT(judge_light(exam), says(doctor::Grade::ok, "no flicker, constant"));
  exam.trial->light->flicker = capture::Flicker{.light_hz = 100, .modulation = 0.032, .bands = 3};
  exam.trial->light->exposure_change = 0.13;
  const auto findings = judge_light(exam);
  EXPECT_THAT(findings,
              says(doctor::Grade::warning, "flickers at 100 Hz, in bands of 3.2 %", "power_line_frequency: 50 Hz"));
  EXPECT_THAT(findings, says(doctor::Grade::warning, "13 % brighter or darker", "auto_exposure: 1"));
  EXPECT_THAT(findings, says(doctor::Grade::warning, "auto_exposure is manual, but"));
  exam.trial->light = capture::LightFindings{};
  exam.trial->light->flicker = capture::Flicker{.light_hz = 120, .modulation = 0.01, .bands = 2};
  exam.trial->light->balance_change = 0.1;
  EXPECT_THAT(judge_light(exam), says(doctor::Grade::warning, "flickers at 120 Hz", "exposure_time_absolute: 83"));
  EXPECT_THAT(judge_light(exam), says(doctor::Grade::warning, "10 % of red or blue", "white_balance_automatic: 0"));
}

// A camera's raw frames, as doctor takes them from the driver.
TEST(LightExam, SeesFlickerInATrialOfThreeSeconds) {
  constexpr int width = 64, height = 96;
  const capture::StreamFormat format{
      .format = capture::CaptureFormat::yuyv, .width = width, .height = height, .stride = 2 * width, .fps = 30};
  LightExam exam(3);
  std::vector<std::uint8_t> bytes(2 * width * height, 128);
  for (int k = 0; k < 90; ++k) {
    const double t = k / 30.0;
    for (int v = 0; v < height; ++v) {
      const double wave = std::cos(2 * std::numbers::pi * 100 * (t + 0.025 * v / height));
      for (int u = 0; u < width; ++u)
        bytes[std::size_t(2 * (v * width + u))] = std::uint8_t(std::lround((80.0 + u % 50) * (1 + 0.04 * wave)));
    }
    capture::Dequeued frame;
    frame.bytes = bytes;
    frame.at = std::chrono::round<std::chrono::nanoseconds>(std::chrono::duration<double>(100 + t));
    exam.look(frame, format);
  }
  ASSERT_TRUE(exam.findings());
  ASSERT_TRUE(exam.findings()->flicker);
  EXPECT_EQ(exam.findings()->flicker->light_hz, 100);
}

TEST(ColorWarning, NamesDirectionAndMargin) {
  object_tracking::TargetOptions ball;
  ball.name = "ball";
  object_trackers::ColorHealth health;
  EXPECT_EQ(reports::color_warning(ball, "cam1", health, false), "");
  health.seen = object_trackers::SeenColor{{12.4, 0.35, 0.2}, {}, {}};
  health.near_end = object_trackers::NearEnd{object_trackers::ColorAxis::hue, true, 3.2};
  EXPECT_EQ(reports::color_warning(ball, "cam1", health, false),
            "ball in cam1: the colour differs by 12 degrees from the configured one, 3 degrees before the end of its "
            "range: fix "
            "white balance and exposure, teach it, or set color: {adapt: true}");
  EXPECT_THAT(reports::color_warning(ball, "cam1", health, true),
              testing::EndsWith("end of its range: teach it, or set color: {adapt: true}"));
  health.near_end = object_trackers::NearEnd{object_trackers::ColorAxis::intensity, false, 0.04};
  EXPECT_THAT(reports::color_warning(ball, "cam1", health, false),
              HasSubstr("darker than the configured one (intensity 0.20)"));
  health.near_end = object_trackers::NearEnd{object_trackers::ColorAxis::saturation, false, -0.04};
  EXPECT_THAT(reports::color_warning(ball, "cam1", health, false), HasSubstr("0.04 beyond its range"));
  ball.adapts_color = true;
  EXPECT_THAT(reports::color_warning(ball, "cam1", health, false), HasSubstr("color: adapt follows it"));
  health.followed[1] = -object_trackers::furthest_followed[1];
  EXPECT_THAT(reports::color_warning(ball, "cam1", health, false), HasSubstr("has reached its limit"));
}

// ---- A replay

class WanderingReplay : public testing::Test {
 protected:
  WanderingReplay() : folder_(fs::path(testing::TempDir()) / "light_test_wandering") { fs::remove_all(folder_); }
  ~WanderingReplay() override { fs::remove_all(folder_); }

  // Three cameras and a ball; all colours turn from the second second on.
  void film() const {
    constexpr double fps = 30;
    const scene::Scene world = scene::circling_ball();
    const auto sets = scene::wandering(scene::render(world, {.set_count = int(fps), .fps = fps}), fps, 13,
                                       [](double t) { return 3 * std::clamp(t - 1, 0.0, 12.0); });
    recordings::RecordingWriter writer({.folder = folder_,
                                        .cameras = {"cam0", "cam1", "cam2"},
                                        .rig_yaml = calib::to_yaml(world.rig),
                                        .config_yaml = {}});
    for (const auto& set : sets)
      for (const auto& frame : set.frames) writer.write(*frame);
    writer.finish();
  }
  ReplaySummary play(const std::string& adapt) const {
    std::ofstream(folder_ / "c.yaml") << "version: 1\nrig: rig.yaml\ntargets: {lime: {radius_m: 0.08, color: {hue_deg: "
                                         "[65, 115], adapt: "
                                      << adapt << "}}}\n";
    ReplayCommand command;
    command.config = folder_ / "c.yaml";
    command.recording = {folder_};
    command.no_dds = true;
    command.progress = false;
    return replay(command, {});
  }
  const fs::path folder_;
};

TEST_F(WanderingReplay, WarnsAndKeepsTrackingIfItAdapts) {
  film();
  const ReplaySummary plain = play("false"), adapted = play("true");
  EXPECT_GT(plain.targets[0].sets.count(TrackState::lost), 0u);
  EXPECT_THAT(plain.light, Contains(AllOf(HasSubstr("lime in cam1: the colour differs by"),
                                          HasSubstr("degrees from the configured one"), HasSubstr("adapt: true"))));
  EXPECT_THAT(to_text(plain, {}), HasSubstr("  light   from "));
  EXPECT_TRUE(has_trouble(plain));
  EXPECT_FALSE(has_trouble(adapted));
  EXPECT_EQ(plain.light.size(), 1u);  // of one target, whatever happened in three cameras
  EXPECT_EQ(adapted.targets[0].sets.count(TrackState::lost), 0u);
  EXPECT_EQ(adapted.targets[0].sets.count(TrackState::coasting), 0u);
  EXPECT_THAT(adapted.light,
              ElementsAre(AllOf(HasSubstr("lime"), HasSubstr("its colour in cam1 was followed, at the end by +"))));
}

TEST(ReplayText, ProblemsAreLastWithMistakesAtTheEnd) {
  ReplaySummary summary;
  summary.times = {"a time"};
  summary.light = {"a lamp"};
  summary.calibration = {"a tripod"};
  summary.mistakes = {"two videos"};
  TargetSummary target;
  target.name = "lime";
  target.advice = "a radius";
  summary.targets = {target};
  const std::string problems = "  light   a lamp\n  cameras a tripod\n  search  lime: a radius\n  mistake two videos\n";
  EXPECT_EQ(problems_text(summary), problems);
  EXPECT_THAT(to_text(summary, {}), testing::EndsWith("  times   a time\n" + problems));
  EXPECT_EQ(problems_text({}), "");
}

// Even if it is over.
TEST(ReplaySummary, AMistakeACameraAndALostColorAreTrouble) {
  ReplaySummary reported;
  reported.light = {"a lamp"}, reported.calibration = {"a box"};
  EXPECT_FALSE(has_trouble(reported));
  ReplaySummary swapped, blinded, pale;
  swapped.mistakes = {"two videos"};
  blinded.has_camera_trouble = true;
  pale.has_lost_color = true;
  for (const ReplaySummary& summary : {swapped, blinded, pale}) EXPECT_TRUE(has_trouble(summary));
}

TEST(ReplayText, PausesDoNotCountAsWallTime) {
  ReplaySummary summary;
  summary.recorded_s = 5;
  summary.wall_s = 0.5;
  EXPECT_THAT(to_text(summary, {}), HasSubstr("5.000 s of recording in 0.500 s, 10.0x real time\n"));
  summary.held_s = 14.3;
  EXPECT_THAT(to_text(summary, {}), HasSubstr("10.0x real time; paused for 14.3 s in addition\n"));
}

}  // namespace
}  // namespace huetrack::daemon
