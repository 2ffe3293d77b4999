#include "reports/search_advice.h"

#include <gmock/gmock.h>

namespace huetrack::reports {
namespace {

using testing::AllOf;
using testing::HasSubstr;

object_tracking::TargetOptions target_of(double radius_m) {
  object_tracking::TargetOptions target;
  target.name = "ball";
  target.radius_m = radius_m;
  target.color.hue_min_deg = 10, target.color.hue_max_deg = 22;
  return target;
}

objects::SearchFindings findings_of(std::vector<std::size_t> sets_with_color) {
  objects::SearchFindings out;
  out.sets = 100;
  out.sets_with_color = std::move(sets_with_color);
  return out;
}

TEST(SearchAdvice, NoneWithoutASearch) {
  EXPECT_EQ(search_advice({}, target_of(0.04), {"a", "b"}, false), "");
}

TEST(SearchAdvice, StatesAWrongRadius) {
  objects::SearchFindings findings = findings_of({100, 100});
  findings.radius_m = 0.04;
  EXPECT_THAT(search_advice(findings, target_of(0.1), {"a", "b"}, false),
              AllOf(HasSubstr("a radius of 0.03 to 0.053 m, not 0.1: measure it, and correct radius_m"),
                    HasSubstr("colour is too narrow")));
  EXPECT_THAT(search_advice(findings, target_of(0.02), {"a", "b"}, false), HasSubstr("colour is too wide"));
  EXPECT_THAT(search_advice(findings, target_of(0.045), {"a", "b"}, false), HasSubstr("their rays do not meet"));
}

TEST(SearchAdvice, SaysNothingOfTheRadiusWhereTheViewsContradictOneAnother) {
  objects::SearchFindings findings = findings_of({100, 100});
  findings.radius_m = findings.radius_before_m = 0.08;
  EXPECT_THAT(search_advice(findings, target_of(0.04), {"a", "b"}, true),
              AllOf(testing::Not(HasSubstr("radius")), HasSubstr("correct the calibration first")));
  EXPECT_EQ(late_advice(findings, target_of(0.04), true), "");
}

TEST(SearchAdvice, NamesCamerasThatDoNotShowTheColor) {
  EXPECT_THAT(search_advice(findings_of({0, 9}), target_of(0.04), {"a", "b"}, false),
              HasSubstr("no camera shows a region of its colour"));
  EXPECT_THAT(search_advice(findings_of({10, 9}), target_of(0.04), {"a", "b"}, false),
              HasSubstr("its colour is seen by a but hardly ever by b: set camera_colors"));
}

TEST(SearchAdvice, NamesTheColorThatTheHueMeansAlsoInOpenCvUnits) {
  EXPECT_THAT(search_advice(findings_of({0, 9}), target_of(0.04), {"a", "b"}, false),
              AllOf(HasSubstr("hue_deg [10, 22] is"), HasSubstr("OpenCV"), HasSubstr("write [20, 44]")));
}

TEST(SeldomAdvice, NamesTheColorThatTheHueMeans) {
  EXPECT_EQ(seldom_advice(0.5, target_of(0.04)), "");
  EXPECT_THAT(
      seldom_advice(0.16, target_of(0.04)),
      AllOf(HasSubstr("in only 16 % of the sets"), HasSubstr("hue_deg [10, 22] is"), HasSubstr("write [20, 44]")));
  object_tracking::TargetOptions blue = target_of(0.04);
  blue.color.hue_min_deg = 210, blue.color.hue_max_deg = 250;
  EXPECT_EQ(seldom_advice(0.16, blue), "");
}

TEST(UnsureAdvice, NamesTheOpenCvRangeOfAnObjectThatIsNoBallOfThisRadius) {
  EXPECT_EQ(unsure_advice(0.05, target_of(0.04)), "");
  EXPECT_THAT(unsure_advice(0.97, target_of(0.04)),
              AllOf(HasSubstr("its sigma was above its radius, 40 mm, in 97 % of the sets"),
                    HasSubstr("hue_deg [10, 22] is"), HasSubstr("write [20, 44]")));
  object_tracking::TargetOptions blue = target_of(0.04);
  blue.color.hue_min_deg = 210, blue.color.hue_max_deg = 250;
  EXPECT_EQ(unsure_advice(0.97, blue), "");
}

TEST(LateAdvice, StatesTheRadiusThatTheSearchSaw) {
  objects::SearchFindings findings;
  EXPECT_EQ(late_advice(findings, target_of(0.04), false), "");
  findings.radius_before_m = 0.04;
  EXPECT_EQ(late_advice(findings, target_of(0.04), false), "");
  findings.radius_before_m = 0.08;
  EXPECT_THAT(late_advice(findings, target_of(0.04), false),
              HasSubstr("it was found late: the pictures of ball show a radius of 0.06 to 0.11 m"));
}

}  // namespace
}  // namespace huetrack::reports
