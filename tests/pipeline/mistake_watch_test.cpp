// Inflation by setup mistakes, and its effect on published positions.
#include "pipeline/mistake_watch.h"

#include <gmock/gmock.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <utility>

#include "scene/lime.h"
#include "truth/truth.h"

namespace huetrack::pipeline {
namespace {

using Eigen::Vector3d;
using scene::lime;
using scene::turn;
using testing::DoubleEq;
using testing::Each;
using testing::ElementsAre;
using view_watch::Mistake;
using view_watch::MistakeKind;

constexpr double rad = std::numbers::pi / 180;

struct Followed {
  double nees = 0;    // mean, of the second half of the sets
  int published = 0;  // positions in it
  std::size_t changes = 0;
  std::vector<double> inflation;
};

// As the pipeline does it; is_applied: the trackers get the inflation.
Followed follow(const scene::Scene& scene, const calib::CameraRig& rig, bool is_applied) {
  const auto sets = scene::render(scene, {.set_count = 150, .pixel_noise_stddev = 3, .seed = 4});
  const std::vector targets{lime()};
  std::vector<object_trackers::ObjectTracker> trackers;
  trackers.emplace_back(rig, targets[0], object_tracking::ObjectTrackerOptions{});
  MistakeWatch watch(rig, targets);
  Followed out;
  std::vector<object_tracking::ObjectEstimate> estimates;
  for (std::size_t k = 0; k < sets.size(); ++k) {
    trackers[0].update(sets[k], estimates);
    if (watch.look(sets[k], estimates, trackers, {})) {
      ++out.changes;
      std::vector<object_tracking::CameraTrust> trust;
      add_inflation(watch.inflation(), trust);
      if (is_applied) trackers[0].trust(trust);
    }
    if (k < sets.size() / 2 || !estimates[0].has_position()) continue;
    const Vector3d off = estimates[0].position - scene.balls[0].path(capture::seconds(sets[k].at - sets.front().at));
    out.nees += truth::nees(off, estimates[0].covariance);
    ++out.published;
  }
  out.nees /= std::max(1, out.published);
  out.inflation = watch.inflation();
  return out;
}

TEST(MistakeWatch, ATurnedCameraIsInflatedByItsTurn) {
  const scene::Scene scene = scene::lime_that_flies();
  calib::CameraRig rig = scene.rig;
  turn(rig.cameras[1], 2 * rad, {1, -0.6, 0.3});
  const Followed inflated = follow(scene, rig, true);
  EXPECT_GT(inflated.changes, 0u);
  EXPECT_NEAR(inflated.inflation[1] / rad, 2, 0.4);
  EXPECT_EQ(inflated.inflation[0], 0);
  EXPECT_EQ(inflated.inflation[2], 0);
  EXPECT_GT(inflated.published, 40);
  EXPECT_LT(inflated.nees, 6) << "the covariance must include the rig's error";
}

TEST(MistakeWatch, AWrongRigPublishesNothingConfident) {
  const scene::Scene scene = scene::lime_that_flies();
  calib::CameraRig rig = scene.rig;
  turn(rig.cameras[0], 3 * rad, {0.2, 1, 0.4});
  turn(rig.cameras[2], 3 * rad, {1, 0.3, -0.8});
  const Followed inflated = follow(scene, rig, true), plain = follow(scene, rig, false);
  EXPECT_GT(inflated.inflation[0], 0);
  EXPECT_LT(inflated.nees, 6);
  EXPECT_LT(inflated.nees, 0.5 * plain.nees) << "by the trackers' own inflation alone";
}

TEST(MistakeWatch, AGoodRigIsNotInflated) {
  const scene::Scene scene = scene::lime_that_flies();
  const Followed inflated = follow(scene, scene.rig, true);
  EXPECT_EQ(inflated.changes, 0u);
  EXPECT_THAT(inflated.inflation, Each(DoubleEq(0)));
}

// Clutter of the ball's colour; each camera sees another piece as the largest before the ball appears.
TEST(MistakeWatch, ClutterOfTheColourIsNoMistake) {
  scene::SceneBuilder builder;
  builder.cameras_on_ring({.count = 3});
  builder.ball({.path = [](double t) {
    if (t < 1) return Vector3d(0, 0, 20);  // nowhere
    return Vector3d(0.6 * std::sin(2.1 * t), 0.6 * std::cos(1.7 * t), 1.2 + 0.3 * std::sin(2.9 * t));
  }});
  for (const double angle : {0.4, 1.5, 3.0, 4.4})
    builder.ball({.radius_m = 0.12,
                  .path = [=](double t) {  // by a pixel or two, as the middle of wood whose edges flicker
                    const double sway_m = 0.014 * std::sin(9 * t + angle);
                    return Vector3d((1.3 + sway_m) * std::cos(angle), (1.3 - sway_m) * std::sin(angle), 0.5 + sway_m);
                  }});
  const scene::Scene scene = builder.build();
  const Followed inflated = follow(scene, scene.rig, true);
  EXPECT_EQ(inflated.changes, 0u);
  EXPECT_GT(inflated.published, 70);
}

// room_watch has detected the moved camera: neither it nor the others are named.
TEST(MistakeWatch, AMovedCameraIsNoMistake) {
  const scene::Scene scene = scene::lime_that_flies();
  calib::CameraRig rig = scene.rig;
  turn(rig.cameras[1], 2 * rad, {1, -0.6, 0.3});
  const std::vector targets{lime()};
  std::vector<object_trackers::ObjectTracker> trackers;
  trackers.emplace_back(rig, targets[0], object_tracking::ObjectTrackerOptions{});
  MistakeWatch watch(rig, targets);
  std::vector<object_tracking::ObjectEstimate> estimates;
  for (const auto& set : scene::render(scene, {.set_count = 90, .seed = 4})) {
    trackers[0].update(set, estimates);
    EXPECT_FALSE(watch.look(set, estimates, trackers, {false, true, false}));
  }
  EXPECT_THAT(watch.mistakes()[0], testing::IsEmpty());
}

// A moved camera does not hide a late camera and a wrong radius.
TEST(MistakeWatch, OtherMistakesAreNamedBesideAMovedCamera) {
  scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 4}).build();
  scene.balls = scene::lime_that_flies().balls;
  calib::CameraRig rig = scene.rig;
  turn(rig.cameras[1], 2 * rad, {1, -0.6, 0.3});
  for (const bool is_late : {true, false}) {
    std::vector targets{lime()};
    if (!is_late) targets[0].radius_m *= 1.4;
    std::vector<object_trackers::ObjectTracker> trackers;
    trackers.emplace_back(rig, targets[0], object_tracking::ObjectTrackerOptions{});
    MistakeWatch watch(rig, targets);
    std::vector<object_tracking::ObjectEstimate> estimates;
    auto sets = scene::render(scene, {.set_count = 150, .seed = 4});
    for (std::size_t k = sets.size(); is_late && k-- > 6;) sets[k].frames[2]->pixels = sets[k - 6].frames[2]->pixels;
    sets.erase(sets.begin(), sets.begin() + 6);
    std::vector<MistakeKind> named;
    for (const auto& set : sets) {
      trackers[0].update(set, estimates);
      watch.look(set, estimates, trackers, {false, true, false, false});
      if (!watch.late_s().empty()) trackers[0].correct_times(watch.late_s());
      for (const Mistake& mistake : watch.mistakes()[0])
        if (std::ranges::find(named, mistake.kind) == named.end()) named.push_back(mistake.kind);
    }
    EXPECT_THAT(named, ElementsAre(is_late ? MistakeKind::late : MistakeKind::radius));
  }
}

TEST(MistakeWatch, InflationIsAsLargeAsTheMistake) {
  const scene::Scene scene = scene::lime_that_flies();
  const calib::Camera& camera = scene.rig.cameras[0];
  const double f = camera.model.fx();
  EXPECT_NEAR(inflation_rad({.kind = MistakeKind::turned, .cameras = {0}, .size = 0.03}, camera), 0.03, 1e-12);
  EXPECT_NEAR(inflation_rad({.kind = MistakeKind::contradiction, .off_px = 6.745}, camera), 10 / f, 1e-3 / f);
  const double usual_px = std::hypot(camera.image_size.width, camera.image_size.height) / std::sqrt(12.0);
  EXPECT_NEAR(inflation_rad({.kind = MistakeKind::zoomed, .cameras = {0}, .size = 0.9}, camera), 0.1 * usual_px / f,
              1e-6);
  EXPECT_EQ(inflation_rad({.kind = MistakeKind::radius, .size = 0.05}, camera), 0);
  std::vector<object_tracking::CameraTrust> trust(1);
  trust[0].pose_covariance(0, 0) = 1e-6;
  add_inflation(std::vector{0.0, 0.01}, trust);
  ASSERT_EQ(trust.size(), 2u);
  EXPECT_DOUBLE_EQ(trust[0].pose_covariance(0, 0), 1e-6);
  EXPECT_DOUBLE_EQ(trust[1].pose_covariance(2, 2), 1e-4);
  EXPECT_EQ(trust[1].pose_covariance(3, 3), 0);
}

}  // namespace
}  // namespace huetrack::pipeline
