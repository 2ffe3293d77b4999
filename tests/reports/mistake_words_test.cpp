#include "reports/mistake_words.h"

#include <gmock/gmock.h>

namespace huetrack::reports {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using view_watch::Mistake;
using view_watch::MistakeKind;

std::string text(const Mistake& mistake, bool is_recorded = true) {
  object_tracking::TargetOptions target;
  target.name = "orange";
  target.radius_m = 0.04;
  target.color.hue_min_deg = 10, target.color.hue_max_deg = 22;
  return mistake_text(mistake, target, {"left", "right", "top", "back"}, is_recorded);
}

TEST(MistakeWords, NameCameraSizeAndRemedy) {
  EXPECT_THAT(text({MistakeKind::swapped, {0, 2}, 0, 24}),
              AllOf(HasSubstr("left and top look swapped"), HasSubstr("24 px")));
  EXPECT_THAT(
      text({MistakeKind::late, {1}, 0.2, 8}),
      HasSubstr(
          "right disagrees with the others by 8 px, and by more the faster orange moves: it is about 0.20 s late"));
  EXPECT_THAT(text({MistakeKind::late, {1}, -0.2, 8}), HasSubstr("0.20 s early"));
  EXPECT_THAT(text({MistakeKind::turned, {1}, 0.0209, 8}), HasSubstr("it looks turned by 1.2 degrees"));
  EXPECT_THAT(text({MistakeKind::turned, {0, 1}, 0.0209, 8}),
              AllOf(HasSubstr("left and right disagree by 8 px"), HasSubstr("one of them looks turned")));
  EXPECT_THAT(text({.kind = MistakeKind::turned, .cameras = {1}, .size = 0.0209, .off_px = 8, .zoom = 0.91}),
              HasSubstr("it looks turned by 1.2 degrees since it was calibrated, or its focal length is 0.91 times"));
  EXPECT_THAT(text({MistakeKind::zoomed, {1}, 0.91, 8}),
              AllOf(HasSubstr("right disagrees with the others by 8 px"), HasSubstr("focal length looks 0.91 times")));
  EXPECT_THAT(text({MistakeKind::mirrored, {1}, 0, 30}), HasSubstr("its pictures look mirrored"));
  EXPECT_THAT(text({MistakeKind::mirrored, {0, 1}, 0, 30}),
              AllOf(HasSubstr("left and right disagree by 30 px, and agree if left and right of one of them"),
                    HasSubstr("two cameras do not show whose")));
  EXPECT_THAT(text({MistakeKind::upside_down, {}, 0, 30}),
              HasSubstr("the cameras disagree by 30 px, and agree if all pictures are turned by 180 degrees"));
  EXPECT_THAT(text({MistakeKind::upside_down, {1}, 0, 30}),
              AllOf(HasSubstr("right disagrees with the others by 30 px"), HasSubstr("turned by 180 degrees"),
                    HasSubstr("rotation tag")));
  EXPECT_THAT(text({MistakeKind::late, {1}, 0.1, 0}),
              HasSubstr("right is about 0.10 s late, as the motion of orange shows"));
  EXPECT_THAT(text({MistakeKind::late, {0, 1}, 0.1, 0}), HasSubstr("one of left and right is about 0.10 s late"));
  EXPECT_THAT(text({MistakeKind::late, {1}, 0.2, 8}), HasSubstr("correct its time stamps or timing.latency_s"));
  for (const double off_px : {0., 8.})
    EXPECT_THAT(text({MistakeKind::late, {1}, 0.2, off_px}, false), HasSubstr("time stamps or latency_offset_s"));
  EXPECT_THAT(text({.kind = MistakeKind::late, .cameras = {0, 1}, .size = 0.031, .off_px = 2, .shown_hz = 30}),
              HasSubstr("about 0.03 s late: correct its time stamps or timing.latency_s; that is one frame: has its "
                        "table of times a row too many or too few"));
  for (const double hz : {0., 20., 60.})
    EXPECT_THAT(text({.kind = MistakeKind::late, .cameras = {1}, .size = 0.031, .shown_hz = hz}),
                testing::Not(HasSubstr("one frame")));
  EXPECT_THAT(text({MistakeKind::uneven_times, {0, 2}, 0.067, 9}),
              AllOf(HasSubstr("the time stamps of left and top are wrong"), HasSubstr("by up to 0.07 s"),
                    HasSubstr("timestamps")));
  EXPECT_THAT(text({MistakeKind::uneven_times, {0, 2, 3}, 0.067, 9}), HasSubstr("of left, top and back are wrong"));
  // An estimate that diverged is no error that was measured.
  EXPECT_THAT(text({MistakeKind::uneven_times, {1}, 12.605, 9}),
              AllOf(HasSubstr("the time stamps of right are wrong, by varying amounts"),
                    testing::Not(HasSubstr("12.6")), testing::Not(HasSubstr("up to"))));
  EXPECT_THAT(
      text({.kind = MistakeKind::converted, .cameras = {1}, .size = 0.0096, .shown_hz = 25, .source_hz = 30.1}),
      AllOf(HasSubstr("right's film looks converted from about 30 to 25 pictures a second, as the path of orange"),
            HasSubstr("dropped"), HasSubstr("10 ms (1 sigma)"), HasSubstr("as the camera recorded it")));
  EXPECT_THAT(text({.kind = MistakeKind::converted, .cameras = {1}, .size = 0.01, .shown_hz = 60, .source_hz = 30.2}),
              AllOf(HasSubstr("repeatedly"), HasSubstr("every: 2")));
  EXPECT_THAT(text({MistakeKind::exchanged, {1}, 0.03}),
              AllOf(HasSubstr("every two pictures of right"), HasSubstr("field")));
  EXPECT_THAT(text({.kind = MistakeKind::delayed, .cameras = {1}, .size = 0.0087, .shown_hz = 29.97}),
              AllOf(HasSubstr("right's pictures vary by 9 ms"), HasSubstr("give fps (about 30)")));
  EXPECT_THAT(text({MistakeKind::contradiction, {}, 0, 9}),
              AllOf(HasSubstr("up to 9 px apart"), HasSubstr("calibrate again")));
  EXPECT_THAT(text({MistakeKind::other_rig, {}, 0, 80}), HasSubstr("another room"));
  EXPECT_THAT(text({.kind = MistakeKind::radius, .size = 0.028, .range_m = {0.025, 0.031}}),
              HasSubstr("the pictures of orange show a radius of 0.025 to 0.031 m, not 0.04: measure it, and correct"));
  EXPECT_THAT(text({MistakeKind::shared_color, {2}, 0.12, 0}),
              HasSubstr("the colour of orange covers 12 % of top's picture"));
}

// Nothing of a live camera is a file.
TEST(MistakeWords, AdviceForLiveCamerasIsAboutCameras) {
  const std::vector<Mistake> all{
      {MistakeKind::swapped, {0, 2}, 0, 24},
      {.kind = MistakeKind::late, .cameras = {0, 1}, .size = 0.031, .off_px = 2, .shown_hz = 30},
      {MistakeKind::uneven_times, {0, 2}, 0.067, 9},
      {MistakeKind::upside_down, {1}, 0, 30},
      {.kind = MistakeKind::wrong_order, .size = 0.4, .jumps = 5},
      {.kind = MistakeKind::converted, .cameras = {1}, .size = 0.01, .shown_hz = 60, .source_hz = 30.2},
      {.kind = MistakeKind::converted, .cameras = {1}, .size = 0.01, .shown_hz = 25, .source_hz = 30.1},
      {MistakeKind::exchanged, {1}, 0.03},
      {.kind = MistakeKind::delayed, .cameras = {1}, .size = 0.0087, .shown_hz = 29.97}};
  for (const Mistake& mistake : all) {
    const auto about_files = testing::ContainsRegex(
        "videos|the film again|give the film|recording.yaml|names of image files|ffmpeg|a row too many|give fps");
    EXPECT_THAT(text(mistake), about_files);
    EXPECT_THAT(text(mistake, false), testing::Not(about_files));
  }
}

}  // namespace
}  // namespace huetrack::reports
