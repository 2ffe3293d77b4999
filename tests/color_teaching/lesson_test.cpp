#include "color_teaching/lesson.h"

#include <gmock/gmock.h>

#include "benchmark/tracking_figures.h"

namespace huetrack::color_teaching {
namespace {

using namespace testing;

TEST(Lesson, FromOneClickToTheTargetsColour) {
  if (!figures::have("rendered/two_cams")) GTEST_SKIP() << "no recording in " << figures::shared_data();
  const figures::Sequence s = figures::load_sequence(figures::shared_data() / "rendered/two_cams");
  const object_tracking::Volume volume = figures::rendered_options(object_tracking::Observation::huetrack, 1).volume;
  const ColorTeacher teacher(s.rig, s.sets[0]);
  const auto row = s.row("lime", s.sets[0].at);
  TeachRequestOptions request;
  request.points = {{0, s.rig.cameras[0].project_world(row->position)->px}};
  object_tracking::TargetOptions lime = figures::lime_ball(), same = lime;
  same.name = "same";
  lime.color = {.hue_min_deg = 200, .hue_max_deg = 220};

  // The other view is suggested, and the way it stands is not confirmed.
  const Lesson one = learn(teacher, request, {lime, same}, lime, volume);
  EXPECT_THAT(one.unconfirmed, ElementsAre(s.rig.cameras[1].name));
  EXPECT_THAT(one.namesakes, ElementsAre("same"));
  EXPECT_EQ(one.why_useless, "");
  EXPECT_EQ(one.target.name, lime.name);
  EXPECT_EQ(one.target.color, one.taught.views[0].color);
  EXPECT_THAT(one.target.camera_colors, IsEmpty());
  EXPECT_FALSE(one.is_faint);

  // With suggestions accepted it is as if both had been pointed at.
  request.accepts_suggestions = true;
  const Lesson accepted = learn(teacher, request, {lime}, lime, volume);
  TeachRequestOptions both;
  both.points = {request.points[0], {1, one.taught.views[1].region->centre}};
  const Lesson pointed = learn(teacher, both, {lime}, lime, volume);
  EXPECT_THAT(accepted.unconfirmed, IsEmpty());
  EXPECT_THAT(accepted.namesakes, IsEmpty());
  EXPECT_EQ(accepted.radius.radius_m, pointed.radius.radius_m);
  EXPECT_EQ(accepted.target.color, pointed.target.color);
  EXPECT_EQ(accepted.target.camera_colors, pointed.target.camera_colors);
  EXPECT_EQ(accepted.target.camera_colors.size(), 2u);

  // The size is held to the target's, and narrow ranges to the object.
  lime.radius_m = 0.01;
  both.wider = -20;
  const Lesson narrow = learn(teacher, both, {lime}, lime, volume);
  EXPECT_THAT(radius_words(narrow.radius, lime.radius_m), HasSubstr("but radius_m says 10 mm"));
  EXPECT_THAT(radius_words(narrow.radius, 0.04), HasSubstr("radius_m says 40 mm, which agrees"));
  EXPECT_TRUE(narrow.is_faint);

  // Where there is nothing coloured nothing is learnt, and the target stays what it is.
  const Lesson nothing = learn(teacher, {.points = {{0, {0, 0}}}}, {lime, same}, lime, volume);
  EXPECT_EQ(nothing.why_useless, "nothing was learnt");
  EXPECT_EQ(nothing.target.color, lime.color);
}

TEST(Lesson, WhatIsSaidOfTheSize) {
  const RadiusProposal told{.radius_m = 0.03724, .sigma_m = 0.0004, .moments = 12, .cameras = 3};
  EXPECT_EQ(
      radius_words(told, {}),
      "It has a radius of 37.2 mm, give or take 0.8 (by 12 moments of 3 cameras), as far as the rig's scale is right.");
  const RadiusProposal rough{.radius_m = 0.029, .sigma_m = 0.0044, .is_rough = true, .moments = 1, .cameras = 2};
  EXPECT_THAT(radius_words(rough, {}), HasSubstr("give or take 9 (by 1 moment of 2 cameras; roughly, by its coloured "
                                                 "regions alone: better measure it), as far as"));
  EXPECT_FALSE(differs_clearly(told, 0.039));
  EXPECT_TRUE(differs_clearly(told, 0.042));
  EXPECT_TRUE(differs_clearly(told, 0.033));
  EXPECT_THAT(radius_words(told, 0.042), HasSubstr("but radius_m says 42 mm"));
  // As unsure as that, nothing contradicts it.
  EXPECT_FALSE(differs_clearly({.radius_m = 0.03724, .sigma_m = 0.004}, 0.042));
  const RadiusProposal unknown{.why_not = "only one camera shows the object"};
  EXPECT_FALSE(differs_clearly(unknown, 1));
  EXPECT_EQ(radius_words(unknown, 0.04), "How large it is cannot be told: only one camera shows the object.");
  EXPECT_THAT(radius_words(unknown, {}), HasSubstr("it is taken for the default"));
}

TEST(Lesson, RectanglesAreAddedPerCamera) {
  object_tracking::IgnoredRegions regions;
  add_ignored(regions, "a", {1, 2, 3, 4});
  add_ignored(regions, "b", {5, 6, 7, 8});
  add_ignored(regions, "a", {0, 0, 9, 9});
  EXPECT_EQ(regions, (object_tracking::IgnoredRegions{{"a", {{1, 2, 3, 4}, {0, 0, 9, 9}}}, {"b", {{5, 6, 7, 8}}}}));
}

}  // namespace
}  // namespace huetrack::color_teaching
