#include "color_teaching/suggestion.h"

#include <gtest/gtest.h>

#include "color_teaching/color_fit.h"
#include "color_teaching/color_teacher.h"
#include "scene/scene.h"

namespace huetrack::color_teaching {
namespace {

using Eigen::Vector3d;

const object_tracking::Volume volume{.min = {-1, -1, 0}, .max = {1, 1, 2}};

Vector3d circling(double t) {
  return {0.5 * std::cos(3 * t), 0.5 * std::sin(3 * t), 1.2};
}

scene::Scene room(std::vector<Vector3d> resting_of_its_color) {
  scene::SceneBuilder builder;
  builder.cameras_on_ring({.count = 3}).ball({.path = circling});
  for (const Vector3d& at : resting_of_its_color) builder.ball({.name = "other", .path = [at](double) { return at; }});
  return builder.build();
}

// What is suggested in the other views for one click at the moving ball, the first or another one, in camera 0.
struct Suggested {
  std::vector<bool> any;
  double furthest_px = 0;  // of those that are suggested
};

// is_live: what moves is known from moments after the click's.
Suggested click(const scene::Scene& world, const std::vector<capture::FrameSet>& sets, std::size_t of,
                bool knows_what_moves, std::size_t ball = 0, bool is_live = false) {
  std::vector<std::vector<capture::Image>> elsewhen(is_live ? 0 : world.rig.cameras.size());
  for (std::size_t i = 0; knows_what_moves && !is_live && i < sets.size(); i += 4)
    for (std::size_t c = 0; c < elsewhen.size(); ++c) elsewhen[c].push_back(sets[i].frames[c]->pixels);
  ColorTeacher teacher(world.rig, sets[of], elsewhen);
  for (std::size_t i = 0; is_live && i < sets.size(); i += 4) teacher.add_moment(sets[i]);
  if (is_live) teacher.learn_motion();
  const Vector3d at = world.ball_at(ball, sets[of].at);
  const Taught taught = teacher.teach({.points = {{0, world.rig.cameras[0].project_world(at)->px}}}, volume);
  EXPECT_TRUE(taught.views[0].pointed) << taught.views[0].problem;
  Suggested result;
  for (std::size_t c = 1; c < world.rig.cameras.size(); ++c) {
    result.any.push_back(taught.views[c].region.has_value());
    if (!taught.views[c].region) continue;
    const Eigen::Vector2d truth = world.rig.cameras[c].project_world(at)->px;
    result.furthest_px = std::max(result.furthest_px, (taught.views[c].region->centre - truth).norm());
  }
  return result;
}

TEST(Suggestion, IsWhereTheBallIs) {
  const scene::Scene world = room({});
  const auto sets = scene::render(world, {.set_count = 40});
  for (std::size_t of = 0; of < sets.size(); of += 8) {
    const Suggested result = click(world, sets, of, false);
    EXPECT_EQ(result.any, (std::vector{true, true})) << of;
    EXPECT_LT(result.furthest_px, 3) << of;
  }
}

// Light from one side leaves the colour that was pointed at on a part of the ball: in the other views it is larger than
// that.
TEST(Suggestion, IsTheWholeWhereAPartWasPointedAt) {
  constexpr double part = 0.58;  // of the radius
  const scene::Scene world = room({});
  const auto sets = scene::render(world, {.set_count = 40});
  for (std::size_t of = 0; of < sets.size(); of += 8) {
    std::vector<HsiImage> images;
    for (const auto& frame : sets[of].frames) images.push_back(hsi_image(frame->pixels));
    const Vector3d at = world.ball_at(0, sets[of].at);
    const auto seen = [&](std::size_t c) { return world.rig.cameras[c].project_world(at)->px; };
    const calib::Camera& camera = world.rig.cameras[0];
    const double radius = part * 0.04 * camera.model.fx() / (camera.cam_from_world * at).norm();
    PixelMask pixels(images[0].width, images[0].height);
    for (int v = 0; v < pixels.height; ++v)
      for (int u = 0; u < pixels.width; ++u)
        pixels.at(u, v) = (Eigen::Vector2d(u, v) - seen(0)).norm() < radius ? 1 : 0;
    const auto regions = regions_of(pixels, 1);
    ASSERT_EQ(regions.size(), 1u);
    const auto found =
        suggested_regions({{{&camera, &images[0]}, regions[0], pixels}},
                          {{&world.rig.cameras[1], &images[1]}, {&world.rig.cameras[2], &images[2]}}, {volume});
    for (std::size_t c : {1u, 2u}) {
      ASSERT_TRUE(found[c - 1]) << of;
      EXPECT_LT((found[c - 1]->region.centre - seen(c)).norm(), 3) << of;
    }
  }
}

// In one-sided light the saturated core of a ball may be a third of it across, and the core is what grows from a click:
// what moved around it, is round and has its hue all over is the ball.
TEST(Suggestion, IsTheWholeWhereASmallCoreWasPointedAt) {
  constexpr double ball_m = 0.06, core_m = 0.02;
  const Vector3d pale(0.5, 0.8, 0.3);
  const auto builder = [&] {
    scene::SceneBuilder out;
    out.cameras_on_ring({.count = 3}).ball({.radius_m = ball_m, .rgb = pale, .path = circling});
    return out;
  };
  const scene::Scene world = builder().build();
  const scene::Scene lit = builder().ball({.name = "core", .radius_m = core_m, .path = circling}).build();
  auto sets = scene::render(world, {.set_count = 40});
  const auto lit_sets = scene::render(lit, {.set_count = 40});
  for (std::size_t i = 0; i < sets.size(); ++i) sets[i].frames[0] = lit_sets[i].frames[0];
  int of_the_core = 0;
  for (std::size_t of = 0; of < sets.size(); of += 8) {
    const Vector3d at = world.ball_at(0, sets[of].at);
    const Eigen::Vector2d px = world.rig.cameras[0].project_world(at)->px;
    const double radius_px =
        ball_m * world.rig.cameras[0].model.fx() / (world.rig.cameras[0].cam_from_world * at).norm();
    const auto grown =
        grow_region(hsi_image(sets[of].frames[0]->pixels), {int(std::lround(px.x())), int(std::lround(px.y()))});
    of_the_core += grown && double(grown->count()) < 0.5 * radius_px * radius_px ? 1 : 0;
    const Suggested result = click(world, sets, of, true);
    EXPECT_EQ(result.any, (std::vector{true, true})) << of;
    EXPECT_LT(result.furthest_px, 3) << of;
  }
  EXPECT_GE(of_the_core, 2);  // or this tests nothing
}

// One thing is in one place. Of two views that show it at different depths of the click's ray one is wrong, and it is
// unknown knows which.
TEST(Suggestion, OfTwoInconsistentOnesNoneIsMade) {
  const Vector3d here = circling(0), from = room({}).rig.cameras[0].centre();
  const auto pictures_of = [](const Vector3d& at) {
    scene::SceneBuilder builder;
    builder.cameras_on_ring({.count = 3}).ball({.path = [at](double) { return at; }});
    return scene::render(builder.build(), {.set_count = 1}).front();
  };
  const scene::Scene world = room({});
  const capture::FrameSet set = pictures_of(here);
  for (const double further_m : {0.0, 0.4}) {
    const Vector3d there = here + further_m * (here - from).normalized();
    const capture::FrameSet other = pictures_of(there);
    const HsiImage images[] = {hsi_image(set.frames[0]->pixels), hsi_image(set.frames[1]->pixels),
                               hsi_image(other.frames[2]->pixels)};
    const Eigen::Vector2d px = world.rig.cameras[0].project_world(here)->px;
    const auto pixels = grow_region(images[0], {int(std::lround(px.x())), int(std::lround(px.y()))});
    ASSERT_TRUE(pixels);
    const auto found =
        suggested_regions({{{&world.rig.cameras[0], &images[0]}, regions_of(*pixels, 1)[0], *pixels}},
                          {{&world.rig.cameras[1], &images[1]}, {&world.rig.cameras[2], &images[2]}}, {volume});
    const bool agree = further_m == 0;
    EXPECT_EQ(found[0].has_value(), agree) << further_m;
    EXPECT_EQ(found[1].has_value(), agree) << further_m;
  }
}

// The same colour and size, on shelves: by the pictures of one moment some of them could be it.
TEST(Suggestion, OfBallsThatRestNoneIsTakenForTheOneThatMoves) {
  const scene::Scene world = room({{-0.6, 0.3, 1.2}, {0.2, -0.7, 1.2}, {0.1, 0.1, 1.2}, {0.7, 0.6, 1.25}});
  const auto sets = scene::render(world, {.set_count = 60});
  for (const bool is_live : {false, true}) {
    int suggested = 0, asked = 0;
    for (std::size_t of = 0; of < sets.size(); of += 6) {
      const Suggested result = click(world, sets, of, true, 0, is_live);
      EXPECT_LT(result.furthest_px, 4) << of;
      for (const bool any : result.any) suggested += any ? 1 : 0, ++asked;
    }
    EXPECT_GE(suggested, asked * 8 / 10) << is_live;
  }
}

// A click at it ran into a cupboard of nearly its colour behind it, and the cupboard was taught.
TEST(Suggestion, IsTheBallThatMovesBeforeFurnitureOfNearlyItsColour) {
  // Behind the ball as camera 0 sees it in the middle of its way; drawn before the ball.
  const Vector3d at = circling(0.5), from = room({}).rig.cameras[0].centre();
  const Vector3d behind = at + 0.8 * (at - from).normalized();
  scene::SceneBuilder builder;
  builder.cameras_on_ring({.count = 3});
  builder.ball(
      {.name = "cupboard", .radius_m = 0.35, .rgb = {0.30, 0.42, 0.08}, .path = [behind](double) { return behind; }});
  const scene::Scene world = builder.ball({.path = circling}).build();
  const auto sets = scene::render(world, {.set_count = 60});
  int before_it = 0;
  for (std::size_t of = 0; of < sets.size(); of += 5) {
    const Vector3d is = world.ball_at(1, sets[of].at);
    const Eigen::Vector2d px = world.rig.cameras[0].project_world(is)->px;
    const HsiImage image = hsi_image(sets[of].frames[0]->pixels);
    const auto grown_blindly = grow_region(image, {int(std::lround(px.x())), int(std::lround(px.y()))});
    const double radius = 0.04 * world.rig.cameras[0].model.fx() / (is - from).norm();
    if (!grown_blindly || double(grown_blindly->count()) > 6 * radius * radius) ++before_it;
    const Suggested result = click(world, sets, of, true, 1);
    EXPECT_LT(result.furthest_px, 4) << of;
  }
  EXPECT_GE(before_it, 2);  // or this tests nothing
}

// Two that could be it, and it is unknown what moves: a wrong suggestion costs more than none.
TEST(Suggestion, AmbiguousOnesAreNotMade) {
  const scene::Scene alone = room({});
  const Vector3d at = circling(0), from = alone.rig.cameras[0].centre();
  // Farther along the ray of the click, and so hidden behind the ball in camera 0, but beside it in the others.
  const scene::Scene world = room({at + 0.25 * (at - from).normalized()});
  const auto sets = scene::render(world, {.set_count = 1});
  EXPECT_LT(click(world, sets, 0, false).furthest_px, 4);
}

// Another of its colour and size, somewhere on the line on which the other view sees the click's ray, is not at one
// place with what the third view shows.
TEST(Suggestion, OfOneColourIsTheOneOfWhichAllViewsAgree) {
  const Vector3d at = circling(0);
  const calib::CameraRig rig = room({}).rig;
  const Vector3d from = rig.cameras[0].centre(), towards = rig.cameras[1].centre() - from;
  int with_a_rival = 0;
  for (const double further : {-0.35, -0.2, 0.15, 0.3, 0.45}) {
    // In the plane of the ray and the other camera's centre, but not on the ray.
    const Vector3d on_ray = at + further * (at - from).normalized();
    const Vector3d other = on_ray + 0.35 * (on_ray - rig.cameras[1].centre()).normalized();
    if (!rig.cameras[1].project_world(other) || towards.norm() == 0) continue;
    ++with_a_rival;
    const scene::Scene world = room({other});
    const auto sets = scene::render(world, {.set_count = 1});
    const Suggested result = click(world, sets, 0, false);
    EXPECT_EQ(result.any, (std::vector{true, true})) << further;
    EXPECT_LT(result.furthest_px, 4) << further;
  }
  EXPECT_GE(with_a_rival, 3);  // or this tests nothing
}

// Of two along the ray of the only other view either may be it, each in its size; the object's radius says which.
TEST(Suggestion, OfTwoAlongTheRayTheKnownRadiusDecides) {
  scene::SceneBuilder builder;
  const Vector3d near = circling(0);
  builder.cameras_on_ring({.count = 3}).ball({.path = [near](double) { return near; }});
  const Vector3d from = builder.build().rig.cameras[0].centre();
  const double distance_m = (near - from).norm();
  const Vector3d far = near + 0.6 * (near - from).normalized();
  const double far_radius_m = 0.04 * (distance_m + 0.6) / distance_m;
  builder.ball({.name = "other", .radius_m = far_radius_m, .path = [far](double) { return far; }});
  const scene::Scene world = builder.build();
  const auto sets = scene::render(world, {.set_count = 1});
  const HsiImage images[] = {hsi_image(sets[0].frames[0]->pixels), hsi_image(sets[0].frames[1]->pixels)};
  const Eigen::Vector2d px = world.rig.cameras[0].project_world(near)->px;
  const auto pixels = grow_region(images[0], {int(std::lround(px.x())), int(std::lround(px.y()))});
  ASSERT_TRUE(pixels);
  const auto found = [&](std::optional<double> radius_m) {
    return suggested_regions({{{&world.rig.cameras[0], &images[0]}, regions_of(*pixels, 1)[0], *pixels}},
                             {{&world.rig.cameras[1], &images[1]}}, {.volume = volume, .radius_m = radius_m})[0];
  };
  EXPECT_FALSE(found({}));
  const auto is_near = found(0.6 * 0.04);  // nearer to the smaller one's
  ASSERT_TRUE(is_near);
  EXPECT_LT((is_near->region.centre - world.rig.cameras[1].project_world(near)->px).norm(), 3);
}

TEST(MovingPixels, AreThoseOfTheBallHereAndNow) {
  const scene::Scene world = room({{-0.6, 0.3, 1.2}});
  const auto sets = scene::render(world, {.set_count = 40});
  std::vector<capture::Image> others;
  for (std::size_t i = 0; i < 40; i += 8) others.push_back(sets[i].frames[0]->pixels);
  const auto mask = moving_pixels(sets[20].frames[0]->pixels, others);
  ASSERT_TRUE(mask);
  const auto is_moving = [&](const Vector3d& at) {
    const Eigen::Vector2d px = world.rig.cameras[0].project_world(at)->px;
    return mask->at(int(std::lround(px.x())), int(std::lround(px.y()))) != 0;
  };
  EXPECT_TRUE(is_moving(world.ball_at(0, sets[20].at)));
  EXPECT_FALSE(is_moving(Vector3d(-0.6, 0.3, 1.2)));
  EXPECT_LT(mask->count(), mask->pixels.size() / 50);
  others.resize(3);
  EXPECT_FALSE(moving_pixels(sets[20].frames[0]->pixels, others));
}

}  // namespace
}  // namespace huetrack::color_teaching
