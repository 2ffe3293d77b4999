// A ball of known colour and radius in pictures in which nothing was pointed at.
#include "color_teaching/found_again.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "color_teaching/color_teacher.h"
#include "scene/scene.h"

namespace huetrack::color_teaching {
namespace {

using namespace testing;

const object_tracking::Volume found_room{Eigen::Vector3d(-1, -1, 0), Eigen::Vector3d(1, 1, 2)};
const Eigen::Vector3d orange(0.85, 0.45, 0.08), wood(0.45, 0.28, 0.12);
constexpr double radius_m = 0.05;

struct Ball {
  Eigen::Vector3d at;
  double radius = radius_m;
  Eigen::Vector3d rgb = orange;
};

scene::Scene scene_of(const std::vector<Ball>& balls) {
  scene::SceneBuilder builder;
  builder.cameras_on_ring({.count = 3, .image_size = {640, 480}, .focal_px = 480});
  for (const Ball& ball : balls)
    builder.ball({.radius_m = ball.radius, .rgb = ball.rgb, .path = [at = ball.at](double) { return at; }});
  return builder.build();
}

// Per ball its views.
std::vector<std::vector<FoundView>> found_in(const std::vector<Ball>& balls, bool several) {
  const scene::Scene scene = scene_of(balls);
  const auto sets = scene::render(scene, {.set_count = 1});
  const color::Hsi paint = color::hsi_of({orange.x(), orange.y(), orange.z()});
  object_tracking::TargetOptions target;
  target.name = "object", target.radius_m = radius_m;
  target.color = {.hue_min_deg = paint.hue_deg - 25,
                  .hue_max_deg = paint.hue_deg + 25,
                  .saturation_min = 0.4,
                  .saturation_max = 1,
                  .intensity_min = 0.05,
                  .intensity_max = 1};
  FoundAgain search(scene.rig, target, std::vector(3, look_of({paint})), found_room);
  return search.in(sets[0], several);
}

void expect_at(const std::vector<FoundView>& ball, const Eigen::Vector3d& at) {
  const calib::CameraRig rig = scene_of({}).rig;
  EXPECT_THAT(ball, SizeIs(3));
  for (const FoundView& found : ball) {
    const double px = (found.view.region.centre - rig.cameras[found.view.camera].project_world(at)->px).norm();
    EXPECT_LT(px, 3) << "camera " << found.view.camera;
    EXPECT_NEAR(std::log(found.view.region.radius_px() / radius_px_of(rig.cameras[found.view.camera], at, radius_m)), 0,
                0.07);
  }
}

TEST(FoundAgain, IsWhereTwoViewsOrMoreShowIt) {
  const Eigen::Vector3d at(0.2, -0.1, 1.1);
  const auto found = found_in({{at}}, false);
  ASSERT_THAT(found, SizeIs(1));
  expect_at(found[0], at);
  EXPECT_THAT(found_in({}, false), IsEmpty());
}

// A region of its hue around it would hide it from a search for regions.
TEST(FoundAgain, BeforeWoodOfItsHueAndAmongThingsOfAnotherSize) {
  const Eigen::Vector3d at(0.2, -0.1, 1.1);
  const auto found = found_in({{at}, {{0, 0, 0.3}, 0.5, wood}, {{-0.6, -0.5, 1.4}, 0.15}}, false);
  ASSERT_THAT(found, SizeIs(1));
  expect_at(found[0], at);
}

TEST(FoundAgain, OfTwoAlikeNeitherUnlessTheTargetHasSeveral) {
  const std::vector<Ball> two{{{0.2, -0.1, 1.1}}, {{-0.4, 0.3, 0.8}}};
  EXPECT_THAT(found_in(two, false), IsEmpty());
  EXPECT_THAT(found_in(two, true), SizeIs(2));
}

// The rig says where it is at other moments, so the views are taught in which nothing is suggested at this one.
TEST(FoundAgain, AcceptAlsoTeachesViewsThatShowItOnlyThen) {
  const scene::Scene scene = scene_of({{{0.2, -0.1, 1.1}}}), later = scene_of({{{-0.3, 0.2, 0.9}}});
  auto set = scene::render(scene, {.set_count = 1})[0];
  const auto hidden = scene::render(scene_of({}), {.set_count = 1})[0];
  for (const std::size_t c : {1u, 2u}) set.frames[c] = hidden.frames[c];
  ColorTeacher teacher(scene.rig, set);
  teacher.add_moment(scene::render(later, {.set_count = 1})[0]);
  TeachRequestOptions request{.points = {{0, scene.rig.cameras[0].project_world({0.2, -0.1, 1.1})->px}},
                              .accepts_suggestions = true,
                              .radius_m = radius_m};
  const Taught one = teacher.teach(request, found_room);
  EXPECT_FALSE(one.views[1].region || one.views[2].region);
  const Taught taught = teacher.held_elsewhere(one, request, found_room, false);
  const color::Hsi paint = color::hsi_of({orange.x(), orange.y(), orange.z()});
  for (const TaughtView& view : taught.views) {
    EXPECT_TRUE(view.pointed);
    EXPECT_TRUE(color::contains(view.color, paint));
    EXPECT_GT(view.object_share, 0.9);
  }
  EXPECT_THAT(taught.moments, SizeIs(1));
  request.accepts_suggestions = false;
  EXPECT_FALSE(teacher.held_elsewhere(teacher.teach(request, found_room), request, found_room, false).views[1].pointed);
}

}  // namespace
}  // namespace huetrack::color_teaching
