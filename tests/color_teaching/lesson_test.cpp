#include "color_teaching/lesson.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "benchmark/tracking_figures.h"
#include "color/color_model.h"
#include "scene/scene.h"

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

  // An accepted suggestion teaches nearly the same as a click in that view, with the narrower ranges that are used
  // then.
  request.accepts_suggestions = true;
  const Lesson accepted = learn(teacher, request, {lime}, lime, volume);
  TeachRequestOptions both;
  both.points = {request.points[0], {1, one.taught.views[1].region->centre}};
  ASSERT_TRUE(accepted.narrowed_to);
  EXPECT_THAT(one.taught.views[0].verdict,
              HasSubstr(fmt::format("narrow it by {} step", request.wider - *accepted.narrowed_to)));
  both.wider = *accepted.narrowed_to;
  const Lesson pointed = learn(teacher, both, {lime}, lime, volume);
  EXPECT_THAT(accepted.unconfirmed, IsEmpty());
  EXPECT_THAT(accepted.namesakes, IsEmpty());
  ASSERT_TRUE(accepted.radius.radius_m && pointed.radius.radius_m);
  EXPECT_NEAR(*accepted.radius.radius_m, *pointed.radius.radius_m, 0.001);
  EXPECT_EQ(accepted.target.color, pointed.target.color);
  ASSERT_EQ(accepted.target.camera_colors.size(), 2u);
  ASSERT_EQ(pointed.target.camera_colors.size(), 2u);
  EXPECT_EQ(accepted.target.camera_colors[0], pointed.target.camera_colors[0]);
  const color::HsiRange& suggested = accepted.target.camera_colors[1].second;
  EXPECT_NEAR(suggested.hue_min_deg, pointed.target.camera_colors[1].second.hue_min_deg, 10);
  EXPECT_NEAR(suggested.hue_max_deg, pointed.target.camera_colors[1].second.hue_max_deg, 10);

  // The size is held to the target's, and narrow ranges to the object.
  lime.radius_m = 0.01;
  both.wider = -20;
  const Lesson narrow = learn(teacher, both, {lime}, lime, volume);
  EXPECT_THAT(radius_words(narrow.radius, lime.radius_m), HasSubstr("but the configured radius is 10 mm"));
  EXPECT_THAT(radius_words(narrow.radius, 0.04), HasSubstr("which agrees with the configured 40 mm"));
  EXPECT_TRUE(narrow.is_faint);

  // Where there is nothing coloured nothing is learnt, and the target stays what it is.
  const Lesson nothing = learn(teacher, {.points = {{0, {0, 0}}}}, {lime, same}, lime, volume);
  EXPECT_EQ(nothing.why_useless, "nothing was learnt");
  EXPECT_EQ(nothing.target.color, lime.color);
}

TEST(Lesson, WordsOfTheRadius) {
  const RadiusProposal proposal{.radius_m = 0.03724, .sigma_m = 0.0004, .moments = 12, .cameras = 3};
  EXPECT_EQ(
      radius_words(proposal, {}),
      "It has a radius of 37.2 mm, give or take 0.8 (by 12 moments of 3 cameras), as far as the rig's scale is right.");
  const RadiusProposal rough{.radius_m = 0.029, .sigma_m = 0.0044, .is_rough = true, .moments = 1, .cameras = 2};
  EXPECT_THAT(radius_words(rough, {}), HasSubstr("give or take 9 (by 1 moment of 2 cameras; roughly, by its coloured "
                                                 "regions alone: better measure it), as far as"));
  EXPECT_FALSE(differs_clearly(proposal, 0.039));
  EXPECT_TRUE(differs_clearly(proposal, 0.042));
  EXPECT_TRUE(differs_clearly(proposal, 0.033));
  EXPECT_THAT(radius_words(proposal, 0.042), HasSubstr("but the configured radius is 42 mm"));
  // As unsure as that, nothing contradicts it.
  EXPECT_FALSE(differs_clearly({.radius_m = 0.03724, .sigma_m = 0.004}, 0.042));
  const RadiusProposal unknown{.why_not = "only one camera shows the object"};
  EXPECT_FALSE(differs_clearly(unknown, 1));
  EXPECT_EQ(radius_words(unknown, 0.04), "Its radius cannot be measured: only one camera shows the object.");
  EXPECT_THAT(radius_words(unknown, {}), HasSubstr("Until radius_m is set, 40 mm is assumed."));
}

TEST(Lesson, RectanglesAreAddedPerCamera) {
  object_tracking::IgnoredRegions regions;
  add_ignored(regions, "a", {1, 2, 3, 4});
  add_ignored(regions, "b", {5, 6, 7, 8});
  add_ignored(regions, "a", {0, 0, 9, 9});
  EXPECT_EQ(regions, (object_tracking::IgnoredRegions{{"a", {{1, 2, 3, 4}, {0, 0, 9, 9}}}, {"b", {{5, 6, 7, 8}}}}));
}

// The same paint in a third of the light: at another moment, or on another one of several.
class OtherLight : public Test {
 protected:
  static constexpr double lit = 1, dark = 0.35;
  static color::Rgb paint(double light) { return {0.45 * light, 0.80 * light, 0.12 * light}; }
  static scene::Scene scene_of(const std::vector<std::pair<double, Eigen::Vector3d>>& balls) {
    scene::SceneBuilder builder;
    builder.cameras_on_ring({.count = 3, .image_size = {320, 240}, .focal_px = 300});
    for (const auto& [light, at] : balls)
      builder.ball(
          {.radius_m = 0.06, .rgb = Eigen::Vector3d(0.45, 0.80, 0.12) * light, .path = [at](double) { return at; }});
    return builder.build();
  }
  // By a click on the first ball in every view.
  static Lesson learnt(const ColorTeacher& teacher, const scene::Scene& scene, int count) {
    TeachRequestOptions request;
    for (int c = 0; c < 3; ++c)
      request.points.push_back({c, scene.rig.cameras[std::size_t(c)].project_world(scene.ball_at(0, {}))->px});
    object_tracking::TargetOptions target;
    target.name = "lime", target.radius_m = 0.06, target.count = count;
    return learn(teacher, request, {target}, target, {});
  }
  static bool holds(const Lesson& lesson, double light) {
    return color::contains(lesson.taught.views[0].color, color::hsi_of(paint(light)));
  }
};

TEST_F(OtherLight, OfAnotherMomentIsHeld) {
  const scene::Scene scene = scene_of({{lit, {0.1, 0.2, 1.1}}}), later = scene_of({{dark, {-0.2, 0.1, 0.9}}});
  const auto sets = render(scene, {.set_count = 1}), later_sets = render(later, {.set_count = 1});
  // Darkness of the same hue is in the room: what is only taught in the light keeps away from it.
  ColorTeacher teacher(scene.rig, sets[0]);
  const Lesson before = learnt(teacher, scene, 1);
  EXPECT_TRUE(holds(before, lit));
  teacher.add_moment(later_sets[0]);
  const Lesson after = learnt(teacher, scene, 1);
  EXPECT_EQ(after.taught.views[0].elsewhere.size(), 1u);
  EXPECT_TRUE(holds(after, lit));
  EXPECT_TRUE(holds(after, dark));
  EXPECT_LE(after.target.color.intensity_min, before.target.color.intensity_min);
}

TEST_F(OtherLight, OfOthersOfSeveralIsHeldAndOfOneAloneItIsARivals) {
  const scene::Scene scene = scene_of({{lit, {0.1, 0.2, 1.1}}, {dark, {-0.3, 0.1, 0.9}}, {dark, {0.2, -0.4, 1.2}}});
  const auto sets = render(scene, {.set_count = 1});
  const ColorTeacher teacher(scene.rig, sets[0]);
  const Lesson one = learnt(teacher, scene, 1);
  EXPECT_TRUE(holds(one, lit));
  EXPECT_FALSE(holds(one, dark));
  const Lesson several = learnt(teacher, scene, 3);
  EXPECT_EQ(several.taught.views[0].alike.size(), 2u);
  EXPECT_TRUE(holds(several, lit));
  EXPECT_TRUE(holds(several, dark));
  EXPECT_FALSE(several.taught.views[0].patch);
}

// Something large, of a hue that the ball's ranges just reach.
TEST(Lesson, OfAcceptedSuggestionsNarrowerRangesLeaveAnotherThingOut) {
  constexpr double radius_m = 0.06;
  const Eigen::Vector3d paint(0.45, 0.80, 0.12);
  const Eigen::Vector3d furniture(0.37, 0.80, 0.16);
  const color::Hsi other = color::hsi_of({furniture.x(), furniture.y(), furniture.z()});
  scene::SceneBuilder builder;
  builder.cameras_on_ring({.count = 3, .image_size = {320, 240}, .focal_px = 300});
  builder.ball({.radius_m = radius_m, .rgb = paint, .path = [](double) { return Eigen::Vector3d(0.1, 0.2, 1.1); }});
  builder.ball({.radius_m = 0.3, .rgb = furniture, .path = [](double) { return Eigen::Vector3d(0, 0, 0.2); }});
  const scene::Scene scene = builder.build();
  const auto sets = render(scene, {.set_count = 1});
  const ColorTeacher teacher(scene.rig, sets[0]);
  TeachRequestOptions request;
  request.points = {{0, scene.rig.cameras[0].project_world(scene.ball_at(0, {}))->px}};
  object_tracking::TargetOptions target;
  target.name = "lime", target.radius_m = radius_m;
  const Lesson pointed = learn(teacher, request, {target}, target, {});
  request.accepts_suggestions = true;
  const Lesson accepted = learn(teacher, request, {target}, target, {});
  EXPECT_FALSE(pointed.narrowed_to);
  EXPECT_TRUE(color::contains(pointed.taught.views[0].color, other));
  EXPECT_THAT(accepted.accepted, SizeIs(2));
  EXPECT_EQ(accepted.why_useless, "");
  ASSERT_TRUE(accepted.narrowed_to);
  EXPECT_LT(*accepted.narrowed_to, 0);
  for (const TaughtView& view : accepted.taught.views) {
    EXPECT_FALSE(color::contains(view.color, other));
    EXPECT_GE(view.object_share, least_object_share);
  }
  EXPECT_EQ(accepted.why_doubtful, "");
  // Where a trial decides the width, the other thing narrows nothing; another width is of the same pixels.
  request.is_tried = true;
  const Lesson tried = learn(teacher, request, {target}, target, {});
  EXPECT_FALSE(tried.narrowed_to);
  EXPECT_TRUE(color::contains(tried.taught.views[0].color, other));
  request.wider = *accepted.narrowed_to;
  const Lesson narrowed = with_width(tried, teacher, request, {target});
  EXPECT_EQ(narrowed.target.color, accepted.target.color);
  EXPECT_EQ(narrowed.target.camera_colors, accepted.target.camera_colors);
  EXPECT_EQ(narrowed.radius.radius_m, tried.radius.radius_m);
  // A requested width is used: only a trial can show that the suggestions are right.
  request.wider = 1;
  const Lesson wider = learn(teacher, request, {target}, target, {});
  EXPECT_FALSE(wider.narrowed_to);
  EXPECT_EQ(wider.why_useless, "");
  EXPECT_THAT(wider.why_doubtful, testing::HasSubstr("of its picture outside the object"));
}

}  // namespace
}  // namespace huetrack::color_teaching
