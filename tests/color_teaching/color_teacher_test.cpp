// Taught on the first pictures of a recording, a colour must hold on the rest.
#include "color_teaching/color_teacher.h"

#include <gmock/gmock.h>

#include "benchmark/tracking_figures.h"

namespace huetrack::color_teaching {
namespace {

using namespace testing;

#define SKIP_WITHOUT(folder) \
  if (!figures::have(folder)) GTEST_SKIP() << "no recording in " << (figures::shared_data() / (folder))

std::vector<TeachPoint> at_truth(const figures::Sequence& s, const std::string& target, std::size_t set,
                                 std::initializer_list<int> cameras) {
  std::vector<TeachPoint> points;
  for (const int c : cameras)
    points.push_back({c, s.rig.cameras[std::size_t(c)].project_world(s.row(target, s.sets[set].at)->position)->px});
  return points;
}

TEST(ColorTeacher, LimeInTwoViewsFromTheirFirstFrames) {
  SKIP_WITHOUT("rendered/two_cams");
  const figures::Sequence s = figures::load_sequence(figures::shared_data() / "rendered/two_cams");
  const object_tracking::ObjectTrackerOptions options =
      figures::rendered_options(object_tracking::Observation::huetrack, 1);
  ColorTeacher teacher(s.rig, s.sets[0]);

  // One click, and where it is in the other view is found.
  const Taught one = teacher.teach({.points = at_truth(s, "lime", 0, {0})}, options.volume);
  ASSERT_TRUE(one.views[0].pointed) << one.views[0].problem;
  EXPECT_FALSE(one.views[1].pointed);
  ASSERT_TRUE(one.views[1].region) << one.views[1].verdict;
  const Eigen::Vector2d truth = at_truth(s, "lime", 0, {1})[0].px;
  EXPECT_LT((one.views[1].region->centre - truth).norm(), 3);

  const TeachRequestOptions request{.points = {at_truth(s, "lime", 0, {0})[0], {1, one.views[1].region->centre}}};
  const Taught both = teacher.teach(request, options.volume);
  // How large it is, by this moment alone, and by others, too.
  for (const Taught& taught : {one, both}) {
    const RadiusProposal radius = teacher.radius(taught);
    ASSERT_TRUE(radius.radius_m) << radius.why_not;
    EXPECT_NEAR(*radius.radius_m, 0.04, 2.5 * radius.sigma_m);
    EXPECT_LT(radius.sigma_m, 0.008);
    EXPECT_EQ(radius.moments, 1u);
    EXPECT_EQ(radius.cameras, 2u);
  }
  for (std::size_t i = 10; i < s.sets.size(); i += 10) teacher.add_moment(s.sets[i]);
  const RadiusProposal voted = teacher.radius(teacher.held_elsewhere(both, request, options.volume, false));
  ASSERT_TRUE(voted.radius_m) << voted.why_not;
  std::printf("radius %.2f mm, sigma %.2f, by %zu moments\n", *voted.radius_m * 1e3, voted.sigma_m * 1e3,
              voted.moments);
  EXPECT_NEAR(*voted.radius_m, 0.04, 0.003);  // of 3 px
  EXPECT_NEAR(*voted.radius_m, 0.04, 2 * voted.sigma_m);
  EXPECT_GT(voted.moments, 8u);
  for (const TaughtView& view : both.views) {
    EXPECT_TRUE(view.pointed);
    EXPECT_LT(view.background_share, 0.001) << view.verdict;
    std::printf("%s: hue %g..%g saturation %g..%g intensity %g..%g\n", view.verdict.c_str(), view.color.hue_min_deg,
                view.color.hue_max_deg, view.color.saturation_min, view.color.saturation_max, view.color.intensity_min,
                view.color.intensity_max);
  }

  EXPECT_THAT(unconfirmed(one, s.rig), ElementsAre(s.rig.cameras[1].name));
  EXPECT_THAT(one.views[1].verdict, AllOf(HasSubstr("probably at"), HasSubstr("% of the background matches here")));
  // Where nothing is suggested, what has the colour may be the object itself, and is not called background.
  const Taught nowhere = teacher.teach({.points = at_truth(s, "lime", 0, {0})}, {.min = {5, 5, 0}, .max = {6, 6, 1}});
  EXPECT_FALSE(nowhere.views[1].region);
  EXPECT_THAT(nowhere.views[1].verdict, AllOf(HasSubstr("no region fits"), HasSubstr("% of the picture matches here"),
                                              EndsWith("is that the object?")));
  EXPECT_THAT(unconfirmed(both, s.rig), IsEmpty());
  EXPECT_GT(both.views[0].object_share, 0.9);
  EXPECT_EQ(why_useless(both, s.rig), "");
  // Another target of this colour is named; its own old colour and others are not.
  object_tracking::TargetOptions same = figures::lime_ball(), blue = figures::lime_ball();
  same.name = "same";
  blue.name = "blue";
  blue.color.hue_min_deg = 200;
  blue.color.hue_max_deg = 240;
  EXPECT_THAT(teacher.namesakes(both, {figures::lime_ball(), same, blue}, figures::lime_ball().name),
              ElementsAre("same"));

  for (const Taught& taught : {one, both}) {
    object_tracking::TargetOptions target = figures::lime_ball();
    target = with_taught_color(target, s.rig, taught);
    ASSERT_THAT(target.problems(), IsEmpty());
    const figures::TrackingFigures f = figures::figures_of(s, "lime", figures::track(s, target, options));
    std::printf("lock in set %zu, rms %.2f mm, max %.2f mm, NEES %.2f, in 95 %%: %.0f %%\n", f.lock_set.value_or(0),
                f.rms_m * 1e3, f.max_m * 1e3, f.mean_nees, f.share_inside_95 * 100);
    ASSERT_TRUE(f.lock_set);
    EXPECT_LE(*f.lock_set, 3u);
    EXPECT_LE(f.rms_m, figures::figures_of(s, "lime", figures::track_blob(s, figures::lime_ball())).rms_m);
    EXPECT_LE(f.max_m, 0.012);
  }
}

TEST(ColorTeacher, TheRedSquareFromTheFirstPair) {
  SKIP_WITHOUT("red_square_stereo");
  const figures::Sequence s = figures::load_sequence(figures::shared_data() / "red_square_stereo");
  const object_tracking::ObjectTrackerOptions options =
      figures::red_square_options(object_tracking::Observation::huetrack, 1);
  const ColorTeacher teacher(s.rig, s.sets[0]);
  // Where it is in the first pair, read off the pictures.
  const Taught one = teacher.teach({.points = {{0, {582, 210}}}}, options.volume);
  ASSERT_TRUE(one.views[0].pointed) << one.views[0].problem;
  ASSERT_TRUE(one.views[1].region) << one.views[1].verdict;
  EXPECT_LT((one.views[1].region->centre - Eigen::Vector2d(328, 190)).norm(), 10);
  const Taught both = teacher.teach({.points = {{0, {582, 210}}, {1, {328, 190}}}}, options.volume);
  for (const TaughtView& view : both.views)
    std::printf("%s: hue %g..%g saturation %g..%g intensity %g..%g\n", view.verdict.c_str(), view.color.hue_min_deg,
                view.color.hue_max_deg, view.color.saturation_min, view.color.saturation_max, view.color.intensity_min,
                view.color.intensity_max);
  // By one moment a square that is seen aslant may be a ball: its radius, if there is one, is rough.
  const RadiusProposal radius = teacher.radius(both);
  if (radius.radius_m) {
    EXPECT_GT(radius.sigma_m, 0.08 * *radius.radius_m);
  }
  object_tracking::TargetOptions target = with_taught_color(figures::red_square(), s.rig, both);
  ASSERT_EQ(target.camera_colors.size(), 2u);
  const std::size_t inside = figures::inside_red_square(s, figures::track(s, target, options));
  std::printf("inside the square in both views: %zu of %zu\n", inside, s.sets.size());
  EXPECT_GE(inside, 107u);  // not in the first sets: other regions of the room have its colour
}

TEST(ColorTeacher, CamerasWithoutAPointKeepTheirColour) {
  calib::CameraRig rig;
  for (const char* name : {"a", "b", "c"}) rig.cameras.emplace_back().name = name;
  const color::HsiRange old{.hue_min_deg = 10, .hue_max_deg = 20}, fresh{.hue_min_deg = 100, .hue_max_deg = 120};
  object_tracking::TargetOptions target;
  target.camera_colors = {{"a", old}, {"c", old}};
  Taught taught;
  taught.views.resize(3);
  taught.views[0].pointed = true;
  taught.views[0].color = fresh;
  taught.views[0].object_share = 0.3;
  target = with_taught_color(target, rig, taught);
  EXPECT_EQ(target.color, fresh);
  ASSERT_EQ(target.camera_colors.size(), 1u);
  EXPECT_EQ(target.camera_colors[0], std::pair(std::string("c"), old));
  // Ranges that hold nothing of the object are refused.
  EXPECT_EQ(why_useless(taught, rig), "");
  taught.views[0].object_share = 0;
  EXPECT_THAT(why_useless(taught, rig), HasSubstr("camera a nothing of the object matches"));
  EXPECT_EQ(why_useless({}, rig), "nothing was learnt");
}

TEST(ColorTeacher, NamesAPatch) {
  SKIP_WITHOUT("rendered/two_cams");
  const figures::Sequence s = figures::load_sequence(figures::shared_data() / "rendered/two_cams");
  const object_tracking::Volume volume = figures::rendered_options(object_tracking::Observation::huetrack, 1).volume;
  const ColorTeacher teacher(s.rig, s.sets[0]);
  const auto points = at_truth(s, "lime", 0, {0, 1});
  const Taught wide = teacher.teach({.points = points, .wider = 12}, volume);
  EXPECT_GT(wide.views[0].background_share, 0.005);
  EXPECT_THAT(wide.views[0].verdict,
              AllOf(HasSubstr("camera cam0: "), HasSubstr("% of the background matches"), HasSubstr("patch of")));
  ASSERT_TRUE(wide.views[0].patch);
  // And what to do about it.
  ASSERT_TRUE(wide.views[0].narrower);
  EXPECT_LE(wide.views[0].narrower->wider, 0);
  EXPECT_GE(wide.views[0].narrower->object_share, least_object_share);
  EXPECT_LT(wide.views[0].narrower->background_share, 0.5 * wide.views[0].background_share);
  EXPECT_THAT(wide.views[0].verdict, HasSubstr(": narrow it by "));
  // As narrow as it gets, little of the object is left, and that is said.
  const Taught narrow = teacher.teach({.points = points, .wider = -20}, volume);
  EXPECT_LT(narrow.views[0].object_share, least_object_share);
  EXPECT_THAT(narrow.views[0].verdict, AnyOf(HasSubstr("only "), HasSubstr("nothing of the object matches")));
  // Ignoring the patch takes it out of the mask and out of the share.
  const Taught ignored = teacher.teach(
      {.points = points, .ignored = {{s.rig.cameras[0].name, {wide.views[0].patch->box}}}, .wider = 12}, volume);
  EXPECT_LT(ignored.views[0].background_share, wide.views[0].background_share);
  EXPECT_LT(ignored.views[0].mask.count(), wide.views[0].mask.count());
}

TEST(ColorTeacher, ReportsThatNothingCanBeLearnt) {
  SKIP_WITHOUT("rendered/two_cams");
  figures::Sequence s = figures::load_sequence(figures::shared_data() / "rendered/two_cams");
  s.sets[0].frames[1].reset();
  const ColorTeacher teacher(s.rig, s.sets[0]);
  const Taught taught = teacher.teach({.points = {{0, {0, 0}}, {1, {5, 5}}}}, {});
  EXPECT_FALSE(taught.any());
  EXPECT_THAT(taught.views[0].verdict, HasSubstr("camera cam0: there is no coloured region"));
  EXPECT_THAT(taught.views[1].verdict, HasSubstr("camera cam1: there is no picture"));

  // One view tells a colour, and no size.
  const Taught one = teacher.teach({.points = at_truth(s, "lime", 0, {0})}, {});
  ASSERT_TRUE(one.any());
  const RadiusProposal radius = teacher.radius(one);
  EXPECT_FALSE(radius.radius_m);
  EXPECT_THAT(radius.why_not, HasSubstr("only one camera shows the object"));
}

}  // namespace
}  // namespace huetrack::color_teaching
