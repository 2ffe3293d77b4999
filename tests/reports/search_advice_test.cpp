#include "reports/search_advice.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "reports/radius_advice.h"

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
  out.sets_in_two = *std::ranges::min_element(out.sets_with_color);
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
              AllOf(testing::Not(HasSubstr("radius")), HasSubstr("the other warnings say why: correct that first"),
                    testing::Not(HasSubstr("calibrat"))));
  EXPECT_EQ(late_advice(findings, target_of(0.04), true), "");
}

TEST(SearchAdvice, NamesCamerasThatDoNotShowTheColor) {
  EXPECT_THAT(search_advice(findings_of({0, 9}), target_of(0.04), {"a", "b"}, false),
              HasSubstr("no camera shows a region of its colour"));
  EXPECT_THAT(search_advice(findings_of({10, 9}), target_of(0.04), {"a", "b"}, false),
              HasSubstr("its colour is seen by a but hardly ever by b: set camera_colors"));
}

TEST(SearchAdvice, OneCameraWhoseRoomHasTheColourTakesANarrowerOne) {
  objects::SearchFindings findings = findings_of({100});
  object_tracking::TargetOptions target = target_of(0.04);
  target.color.saturation_min = 0.09;
  EXPECT_THAT(search_advice(findings, target, {"a"}, false), HasSubstr("no round region of its colour"));
  findings.sets_shared = 60;
  EXPECT_THAT(search_advice(findings, target, {"a"}, false),
              AllOf(HasSubstr("narrow its colour, first of all its saturation, [0.09, 1] now"),
                    testing::Not(HasSubstr("check the radius"))));
  target.shape = object_tracking::TargetShape::blob;
  EXPECT_THAT(search_advice(findings, target, {"a"}, false), HasSubstr("takes two cameras"));
}

// h becomes 240 - h: orange in the place of blue.
TEST(SearchAdvice, NamesTheHueWithRedAndBlueSwappedWhereNoCameraShowsTheColor) {
  object_tracking::TargetOptions blue = target_of(0.04);
  blue.color.hue_min_deg = 195, blue.color.hue_max_deg = 230;
  EXPECT_THAT(search_advice(findings_of({0, 0}), blue, {"a", "b"}, false),
              HasSubstr("(BGR for RGB): hue_deg [10, 45] is red to yellow"));
  blue.color.hue_min_deg = 230, blue.color.hue_max_deg = 250;
  EXPECT_THAT(search_advice(findings_of({0, 0}), blue, {"a", "b"}, false), HasSubstr("hue_deg [350, 10] is red"));
  EXPECT_THAT(search_advice(findings_of({100, 100}), blue, {"a", "b"}, false), testing::Not(HasSubstr("BGR")));
  blue.is_hue_taught = true;
  EXPECT_THAT(search_advice(findings_of({0, 0}), blue, {"a", "b"}, false), testing::Not(HasSubstr("BGR")));
}

TEST(SearchAdvice, NamesTheColorThatTheHueMeansAlsoInOpenCvUnits) {
  EXPECT_THAT(search_advice(findings_of({0, 9}), target_of(0.04), {"a", "b"}, false),
              AllOf(HasSubstr("hue_deg [10, 22] is"), HasSubstr("OpenCV"), HasSubstr("write [20, 44]")));
}

TEST(SearchAdvice, ATaughtHueCannotBeInAnotherUnit) {
  object_tracking::TargetOptions taught = target_of(0.04);
  taught.is_hue_taught = true;
  EXPECT_THAT(search_advice(findings_of({0, 9}), taught, {"a", "b"}, false),
              AllOf(HasSubstr("hue_deg [10, 22] is"), testing::Not(HasSubstr("OpenCV"))));
  EXPECT_EQ(seldom_advice(0.16, taught), "");
  EXPECT_EQ(unsure_advice(0.97, taught), "");
}

TEST(SearchAdvice, NamesAVolumeThatTheBallIsOutsideOf) {
  objects::SearchFindings findings = findings_of({100, 100});
  findings.sets_in_two = 100, findings.sets_outside = 88;
  findings.outside = {.places = Eigen::AlignedBox3d(Eigen::Vector3d(-1.5, 0, 1), Eigen::Vector3d(1.25, 0.5, 2)),
                      .radius_m = 0.042};
  EXPECT_THAT(search_advice(findings, target_of(0.04), {"a", "b"}, false),
              HasSubstr("in 88 % of these sets two cameras see a ball of its colour and size outside of "
                        "object_tracking.volume, at x, y, z from -1.50, 0.00, 1.00 to 1.25, 0.50, 2.00 m: extend"));
  const auto not_outside = testing::Not(HasSubstr("outside"));
  EXPECT_THAT(search_advice(findings, target_of(0.1), {"a", "b"}, false), not_outside) << "of another size";
  EXPECT_THAT(search_advice(findings, target_of(0.04), {"a", "b"}, true), not_outside) << "where the rig is wrong";
  findings.sets_outside = 40;
  EXPECT_THAT(search_advice(findings, target_of(0.04), {"a", "b"}, false), not_outside) << "seldom";
}

TEST(SearchAdvice, APositionTakesTwoViewsAtOnce) {
  objects::SearchFindings findings = findings_of({60, 60});
  findings.sets_in_two = 20;
  EXPECT_THAT(search_advice(findings, target_of(0.04), {"a", "b"}, false),
              HasSubstr("two cameras see its colour at once in only 20 % of these sets"));
}

TEST(LostAdvice, SaysHowOftenAndWhy) {
  EXPECT_THAT(lost_advice(0.43, findings_of({0, 100}), target_of(0.04), {"a", "b"}, false),
              AllOf(HasSubstr("it has no position in 43 % of the sets in which enough cameras delivered; there its "
                              "colour is seen by b but hardly ever by a")));
}

TEST(LostAdvice, DoesNotDoubtTheRigOfWhatIsFoundAtTimes) {
  EXPECT_THAT(
      lost_advice(0.43, findings_of({100, 100}), target_of(0.04), {"a", "b"}, false),
      AllOf(HasSubstr("it is hidden, and other things have its colour"), testing::Not(HasSubstr("calibration"))));
}

// One that is hidden for half of a good recording is no fault of the set-up.
TEST(LostAdvice, OnlyABallThatTwoViewsSeeIsSeenInVain) {
  objects::SearchFindings findings = findings_of({100, 100});
  findings.sets_in_two = findings.sets;
  EXPECT_FALSE(is_seen_in_vain(findings, target_of(0.04)));
  findings.radius_m = 0.041;
  EXPECT_FALSE(is_seen_in_vain(findings, target_of(0.04)));
  findings.radius_m = 0.08;
  EXPECT_TRUE(is_seen_in_vain(findings, target_of(0.04)));
  findings.radius_m.reset();
  findings.outside = {.places = Eigen::AlignedBox3d(Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones()),
                      .radius_m = 0.04};
  findings.sets_outside = findings.sets;
  EXPECT_TRUE(is_seen_in_vain(findings, target_of(0.04)));
  EXPECT_TRUE(is_seen_outside(findings, target_of(0.04)));
  findings.sets_outside = findings.sets / 3;
  EXPECT_FALSE(is_seen_outside(findings, target_of(0.04)));
  EXPECT_FALSE(is_seen_in_vain(findings, target_of(0.04)));
}

TEST(RadiusAdvice, SaysWhatAnUnsetRadiusIs) {
  EXPECT_THAT(unset_radius_text({}, false, target_of(0.04)),
              HasSubstr("no radius of ball is set, and its outlines show none: 0.04 m is assumed"));
  EXPECT_THAT(unset_radius_text({}, true, target_of(0.04)),
              HasSubstr("0.04 m is assumed, which its outlines do not contradict"));
  EXPECT_THAT(unset_radius_text(0.0332, true, target_of(0.04)),
              HasSubstr("0.04 m was assumed until the pictures showed 0.0332 m"));
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
