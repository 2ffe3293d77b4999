// Mistakes that last, and false alarms that are cleared.
#include "reports/mistake_report.h"

#include <gmock/gmock.h>

#include "scene/lime.h"

namespace huetrack::reports {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using view_watch::Mistake;
using view_watch::MistakeKind;

class MistakeReportOfLime : public testing::Test {
 protected:
  void see(double at_s, const std::vector<Mistake>& mistakes,
           const std::vector<pipeline::CameraCalibration>& calibration = {}) {
    see_in(report, at_s, mistakes, calibration);
  }
  static void see_in(MistakeReport& report, double at_s, const std::vector<Mistake>& mistakes,
                     const std::vector<pipeline::CameraCalibration>& calibration = {}) {
    capture::FrameSet frames;
    frames.at = capture::Timestamp(capture::duration_of(at_s));
    const std::vector<std::vector<Mistake>> of_targets{mistakes};
    report.on_set({.frames = frames,
                   .estimates = {},
                   .received_at = {},
                   .trackers = {},
                   .calibration = calibration,
                   .mistakes = of_targets});
  }
  static config::ServiceConfig of_lime() {
    config::ServiceConfig config;
    config.rig = scene::lime_that_flies().rig;
    config.targets = {scene::lime()};
    return config;
  }
  const config::ServiceConfig config = of_lime();
  MistakeReport report{config, true};
};

TEST_F(MistakeReportOfLime, ACorrectedMistakeStaysInTheSummary) {
  see(0, {{.kind = MistakeKind::radius, .size = 0.05, .range_m = {0.045, 0.055}}});
  report.on_config(config);
  see(1, {{.kind = MistakeKind::shared_color, .cameras = {1}, .size = 0.2}});
  see(2, {});
  EXPECT_THAT(report.summary(), ElementsAre(HasSubstr("from 0.0 s on: "), HasSubstr("from 1.0 s on: ")));
}

TEST_F(MistakeReportOfLime, LatenessIsComparedWithTheCamerasFrames) {
  for (const auto& [size_s, is_one_frame] : {std::pair{-0.033, true}, {0.066, false}}) {
    MistakeReport report{config, true};
    for (int k = 0; k < 10; ++k) {
      capture::FrameSet frames;
      frames.at = capture::Timestamp(capture::duration_of(k / 30.));
      frames.frames.resize(2);
      // every second one is dropped
      frames.frames[1] = capture::Frame{.camera = 1,
                                        .sequence = std::uint32_t(7 + 2 * k),
                                        .captured_at = capture::Timestamp(capture::duration_of(2 * k / 30.)),
                                        .pixels = {}};
      const std::vector<std::vector<Mistake>> of_targets{
          {{.kind = MistakeKind::late, .cameras = {1}, .size = size_s, .off_px = 3}}};
      report.on_set({.frames = frames,
                     .estimates = {},
                     .received_at = {},
                     .trackers = {},
                     .calibration = {},
                     .mistakes = of_targets});
    }
    EXPECT_THAT(report.warnings(),
                ElementsAre(is_one_frame ? HasSubstr("that is one frame")
                                         : testing::Matcher<std::string>(testing::Not(HasSubstr("one frame")))));
  }
}

// A radius that follows from views that contradict one another is none.
TEST_F(MistakeReportOfLime, SaysNothingOfTheRadiusWhereTheViewsContradictOneAnother) {
  see(0, {{.kind = MistakeKind::radius, .size = 0.05, .range_m = {0.045, 0.055}}});
  EXPECT_EQ(report.warnings().size(), 1u);
  see(1, {{.kind = MistakeKind::radius, .size = 0.05, .range_m = {0.045, 0.055}},
          {.kind = MistakeKind::contradiction, .off_px = 20}});
  EXPECT_THAT(report.warnings(), ElementsAre(HasSubstr("which camera is wrong cannot be determined")));
  EXPECT_THAT(report.summary(), ElementsAre(HasSubstr("which camera is wrong cannot be determined")));
  EXPECT_TRUE(report.do_views_contradict());
}

// Time stamps that are wrong explain views that contradict one another: the rig is not blamed.
TEST_F(MistakeReportOfLime, DoesNotAdviseToCalibrateWhereTimesAreInDoubt) {
  const Mistake contradiction{.kind = MistakeKind::contradiction, .off_px = 20};
  const auto by_times = AllOf(HasSubstr("time stamps are in doubt"), Not(HasSubstr("calibrate")));
  see(0, {contradiction});
  EXPECT_THAT(report.warnings(), ElementsAre(HasSubstr("calibrate again")));
  see(1, {contradiction, {.kind = MistakeKind::uneven_times, .cameras = {1}, .size = 0.2}});
  EXPECT_THAT(report.warnings(), ElementsAre(by_times, HasSubstr("the time stamps of")));
  EXPECT_THAT(report.summary(), ElementsAre(by_times, HasSubstr("the time stamps of")));
  see(2, {contradiction});
  EXPECT_THAT(report.warnings(), ElementsAre(HasSubstr("calibrate again")));

  // The recording's files say at the end that its times are wrong.
  MistakeReport before{config, true};
  see_in(before, 0, {contradiction, {.kind = MistakeKind::turned, .cameras = {1}, .size = 0.02}});
  EXPECT_THAT(before.summary(), ElementsAre(HasSubstr("calibrate again"), HasSubstr("fasten it and calibrate again")));
  EXPECT_THAT(before.summary(true), ElementsAre(by_times, HasSubstr("fasten it and calibrate again")));
}

// Before a camera's move is mended, its views are inconsistent by what is known already.
TEST_F(MistakeReportOfLime, SaysNothingOfTheRadiusWhileACameraStandsElsewhere) {
  std::vector<pipeline::CameraCalibration> calibration(2);
  calibration[1].moved.emplace();
  calibration[1].is_mended = true;
  see(0, {}, calibration);
  EXPECT_FALSE(report.do_views_contradict());
  calibration[1].is_mended = false;
  see(1, {{.kind = MistakeKind::radius, .size = 0.05, .range_m = {0.045, 0.055}}}, calibration);
  EXPECT_TRUE(report.do_views_contradict());
  EXPECT_THAT(report.warnings(), testing::IsEmpty());
}

// What was measured before a camera was knocked holds.
TEST_F(MistakeReportOfLime, ARadiusThatWasMeasuredBeforeACameraMovedStays) {
  see(0, {{.kind = MistakeKind::radius, .size = 0.05, .range_m = {0.045, 0.055}}});
  std::vector<pipeline::CameraCalibration> calibration(2);
  calibration[1].moved.emplace();
  see(1, {{.kind = MistakeKind::radius, .size = 0.07, .range_m = {0.065, 0.075}}}, calibration);
  EXPECT_TRUE(report.do_views_contradict());
  EXPECT_THAT(report.warnings(), ElementsAre(HasSubstr("0.045 to 0.055 m")));
  EXPECT_THAT(report.summary(), ElementsAre(HasSubstr("0.045 to 0.055 m")));
}

}  // namespace
}  // namespace huetrack::reports
