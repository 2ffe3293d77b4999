#include "color/color_name.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

namespace huetrack::color {
namespace {

using testing::IsEmpty;
using testing::MatchesRegex;

HsiRange hues(double min_deg, double max_deg) {
  HsiRange out;
  out.hue_min_deg = min_deg, out.hue_max_deg = max_deg;
  return out;
}

TEST(ColorName, HuesHaveTheNameOfTheNearestOfTwelve) {
  EXPECT_EQ(hue_name(0), "red");
  EXPECT_EQ(hue_name(44), "orange");
  EXPECT_EQ(hue_name(46), "yellow");
  EXPECT_EQ(hue_name(240), "blue");
  EXPECT_EQ(hue_name(350), "red");
}

TEST(ColorName, SwatchIsInTheRange) {
  for (double min_deg = 0; min_deg < 360; min_deg += 7) {
    for (const double width_deg : {1.0, 40.0, 170.0}) {
      HsiRange range = hues(min_deg, std::fmod(min_deg + width_deg, 360));
      for (const double saturation : {0.1, 0.6, 0.95}) {
        range.saturation_min = saturation, range.saturation_max = saturation + 0.05;
        range.intensity_min = 0, range.intensity_max = 0.9;
        const Rgb middle = middle_of(range);
        EXPECT_LE(std::max({middle.r, middle.g, middle.b}), 1);
        EXPECT_TRUE(contains(range, hsi_of(middle))) << min_deg << " " << width_deg << " " << saturation;
      }
    }
  }
}

TEST(ColorName, TextSaysWhatTheRangeMeans) {
  EXPECT_THAT(hue_text(hues(33, 57)), MatchesRegex("hue_deg \\[33, 57\\] is orange to yellow \\(#[0-9a-f]{6}\\)"));
  EXPECT_THAT(hue_text(hues(355, 5)), MatchesRegex("hue_deg \\[355, 5\\] is red \\(#[0-9a-f]{6}\\)"));
  EXPECT_EQ(hue_text(hues(0, 360)), "hue_deg [0, 360] is any hue");
}

TEST(ColorName, HintOnlyWhereTheNumbersMayBeInAnotherUnit) {
  EXPECT_THAT(other_unit_text(hues(33, 57)), MatchesRegex(".*OpenCV.*write \\[66, 114\\], yellow to green.*"));
  EXPECT_THAT(other_unit_text(hues(0.18, 0.32)), MatchesRegex(".*shares of the circle.*write \\[65, 115\\], .*"));
  EXPECT_THAT(hue_text(hues(0.18, 0.32)), HasSubstr("hue_deg [0.18, 0.32] is red"));
  EXPECT_THAT(other_unit_text(hues(100, 200)), IsEmpty());
  EXPECT_THAT(other_unit_text(hues(170, 10)), IsEmpty());
  EXPECT_THAT(other_unit_text(hues(0, 360)), IsEmpty());
}

}  // namespace
}  // namespace huetrack::color
