#include <gmock/gmock.h>

#include "camera_tracking/camera_tracker.h"

namespace huetrack::camera_tracking {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

RectangleStart rectangle() {
  return {{{-0.1, 0.075, 0}, {0.1, 0.075, 0}, {0.1, -0.075, 0}, {-0.1, -0.075, 0}}, {}};
}
LedStart leds() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 1, 2, 3, -1}};
}

std::vector<std::string> problems(CameraMethod method, const CameraStart& start) {
  CameraTrackerOptions options;
  options.method = method;
  options.start = start;
  return options.problems();
}

TEST(CameraStart, AcceptsValidStarts) {
  EXPECT_THAT(problems(CameraMethod::huetrack, rectangle()), IsEmpty());
  EXPECT_THAT(problems(CameraMethod::herranz, leds()), IsEmpty());
}

TEST(CameraStart, RejectsOtherShapesThanRectangles) {
  RectangleStart crossed = rectangle();
  std::swap(crossed.corners[1], crossed.corners[2]);
  EXPECT_THAT(problems(CameraMethod::lee, crossed), Contains(HasSubstr("in order around it")));
  crossed.corners.pop_back();
  EXPECT_THAT(problems(CameraMethod::lee, crossed), Contains(HasSubstr("not 3")));
}

TEST(CameraStart, RejectsCollinearPointsAndMissingPixels) {
  PointsStart line{{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3, 3, 3}}, {{0, 0}, {1, 1}, {2, 2}, {3, 3}}};
  EXPECT_THAT(problems(CameraMethod::pupilli, line), Contains(HasSubstr("one line")));
  line.pixels.pop_back();
  EXPECT_THAT(problems(CameraMethod::pupilli, line), Contains(HasSubstr("4 points, but 3 pixels")));
}

TEST(CameraStart, RejectsAStartThatTheMethodCannotUse) {
  EXPECT_THAT(problems(CameraMethod::huetrack, leds()), IsEmpty());
  EXPECT_THAT(problems(CameraMethod::lee, leds()), Contains(HasSubstr("herranz")));
  EXPECT_THAT(problems(CameraMethod::herranz, rectangle()), Contains(HasSubstr("needs LEDs")));
}

TEST(CameraStart, AsPrintedNeedsAPapersMethod) {
  CameraTrackerOptions options;
  options.start = rectangle();
  options.as_printed = true;
  EXPECT_THAT(options.problems(), Contains(HasSubstr("as_printed is for")));
  options.method = CameraMethod::lee;
  EXPECT_THAT(options.problems(), IsEmpty());
}

TEST(CameraStart, RejectsFewerThanFourLeds) {
  LedStart three = leds();
  three.leds.pop_back();
  EXPECT_THAT(problems(CameraMethod::herranz, three), Contains(HasSubstr("at least 4 LEDs")));
  EXPECT_THAT(problems(CameraMethod::herranz, three), Contains(HasSubstr("the schedule names LEDs 0 to 2")));
}

}  // namespace
}  // namespace huetrack::camera_tracking
