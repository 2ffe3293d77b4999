#include "reports/search_advice.h"

#include <gmock/gmock.h>

namespace huetrack::reports {
namespace {

using testing::AllOf;
using testing::HasSubstr;

object_tracking::TargetOptions target_of(double radius_m) {
  object_tracking::TargetOptions target;
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
  EXPECT_EQ(search_advice({}, target_of(0.04), {"a", "b"}), "");
}

TEST(SearchAdvice, StatesAWrongRadius) {
  objects::SearchFindings findings = findings_of({100, 100});
  findings.radius_m = 0.04;
  EXPECT_THAT(search_advice(findings, target_of(0.1), {"a", "b"}),
              HasSubstr("a ball of radius 0.04 m, not 0.1: correct radius_m, or widen its colour"));
  EXPECT_THAT(search_advice(findings, target_of(0.02), {"a", "b"}), HasSubstr("or narrow its colour"));
  EXPECT_THAT(search_advice(findings, target_of(0.045), {"a", "b"}), HasSubstr("their rays do not meet"));
}

TEST(SearchAdvice, NamesCamerasThatDoNotShowTheColor) {
  EXPECT_THAT(search_advice(findings_of({0, 9}), target_of(0.04), {"a", "b"}),
              HasSubstr("no camera shows a region of its colour"));
  EXPECT_THAT(search_advice(findings_of({10, 9}), target_of(0.04), {"a", "b"}),
              HasSubstr("its colour is seen by a but hardly ever by b: set camera_colors"));
}

TEST(SearchAdvice, NamesTheColorThatTheHueMeansAlsoInOpenCvUnits) {
  EXPECT_THAT(search_advice(findings_of({0, 9}), target_of(0.04), {"a", "b"}),
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

TEST(LateAdvice, StatesTheRadiusThatTheSearchSaw) {
  objects::SearchFindings findings;
  EXPECT_EQ(late_advice(findings, target_of(0.04)), "");
  findings.radius_before_m = 0.04;
  EXPECT_EQ(late_advice(findings, target_of(0.04)), "");
  findings.radius_before_m = 0.08;
  EXPECT_THAT(late_advice(findings, target_of(0.04)),
              HasSubstr("it was found late: what has its colour has the size of a ball"));
}

}  // namespace
}  // namespace huetrack::reports
