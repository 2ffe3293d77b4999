#include "room_watch/rotation_fit.h"

#include <gmock/gmock.h>

#include <random>

#include "drawn.h"
#include "room_watch/filmed_room.h"

namespace huetrack::room_watch {
namespace {

struct Seen {
  std::vector<SeenRay> rays;
  Eigen::Vector3d rotation;
};

// A grid of directions; `strays` of 10 have another rotation, like something that moves through the picture.
Seen seen_by(const calib::CameraModel& lens, const Eigen::Vector3d& rotation, int strays, double zoom = 0,
             double noise_px = 0.1) {
  Seen seen{.rays = {}, .rotation = rotation};
  std::mt19937 random(4);
  std::normal_distribution<double> normal(0, noise_px);
  int k = 0;
  for (int v = 20; v < 180; v += 25) {
    for (int u = 20; u < 240; u += 25, ++k) {
      const Eigen::Vector3d ray = lens.ray({{u, v}}).value();
      const Eigen::Vector3d by = k * 7 % 10 < strays ? Eigen::Vector3d(0.004, -0.02, 0.003) : rotation;
      Eigen::Vector2d px = lens.project(turned(by, ray)).value().px;
      px += zoom * (px - Eigen::Vector2d(lens.cx(), lens.cy())) + drawn<2>(random, normal);
      seen.rays.push_back({ray, px, noise_px});
    }
  }
  return seen;
}

TEST(RotationFit, FindsTheRotationWithItsCovariance) {
  const auto lens = camera_in_room().model;
  const Seen seen = seen_by(lens, Eigen::Vector3d(0.008, -0.011, 0.006), 0);
  const auto fit = fit_rotation(lens, seen.rays, {.rotation = {0.006, -0.01, 0.006}}, 2);
  ASSERT_TRUE(fit);
  const Eigen::Vector3d off = fit->rotation - seen.rotation;
  EXPECT_LT(off.norm(), 0.02 * degree);
  EXPECT_LT(off.dot(fit->covariance.inverse() * off), 16);  // of 3 degrees of freedom, 1 in 1000
  EXPECT_GT(fit->inliers, 50);
  EXPECT_LT(std::abs(fit->zoom), 4 * fit->zoom_sigma);
}

TEST(RotationFit, OutvotesWhatMovesByItself) {
  const auto lens = camera_in_room().model;
  const Seen seen = seen_by(lens, Eigen::Vector3d(0.0005, 0.0004, 0), 4);
  const auto fit = fit_rotation(lens, seen.rays, {}, 2);
  ASSERT_TRUE(fit);
  EXPECT_LT((fit->rotation - seen.rotation).norm(), 0.015 * degree);
}

TEST(RotationFit, SeparatesZoomFromRotation) {
  const auto lens = camera_in_room().model;
  const Seen seen = seen_by(lens, Eigen::Vector3d(0.002, 0, 0.001), 0, 0.008);
  const auto fit = fit_rotation(lens, seen.rays, {}, 3);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->zoom, 0.008, 0.001);
  EXPECT_LT((fit->rotation - seen.rotation).norm(), 0.02 * degree);
}

TEST(RotationFit, ReportsTheRotationThatAShiftResembles) {
  const calib::Camera camera = camera_in_room();
  const Eigen::Vector3d shift(0.004, -0.003, 0.001);
  constexpr double distance = 3;
  Seen seen = seen_by(camera.model, Eigen::Vector3d::Zero(), 0, 0, 0.01);
  for (SeenRay& s : seen.rays) s.px = camera.model.project(distance * s.ray + shift).value().px;
  const auto fit = fit_rotation(camera.model, seen.rays, {}, 3);
  ASSERT_TRUE(fit);
  EXPECT_LT((fit->rotation - fit->shift_to_rotation * shift / distance).norm(), 0.02 * fit->rotation.norm());
}

TEST(RotationFit, GuessesWithoutAStart) {
  const auto lens = camera_in_room().model;
  const Seen seen = seen_by(lens, Eigen::Vector3d(-0.03, 0.02, 0.05), 3, 0, 0.5);
  const auto guess = guess_aim(lens, seen.rays, 2);
  ASSERT_TRUE(guess);
  EXPECT_LT((guess->rotation - seen.rotation).norm(), 0.5 * degree);
}

TEST(RotationFit, GuessesALargeZoom) {
  const auto lens = camera_in_room().model;
  const Seen seen = seen_by(lens, Eigen::Vector3d(0.01, -0.02, 0), 2, 0.06, 0.5);
  const auto guess = guess_aim(lens, seen.rays, 2);
  ASSERT_TRUE(guess);
  EXPECT_NEAR(guess->zoom, 0.06, 0.01);
  const auto fit = fit_rotation(lens, seen.rays, *guess, 2);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->zoom, 0.06, 0.002);
  EXPECT_LT((fit->rotation - seen.rotation).norm(), 0.12 * degree);
}

TEST(RotationFit, ZoomAndTurnAreConfusedOnOneSide) {
  const auto lens = camera_in_room().model;
  Seen seen = seen_by(lens, Eigen::Vector3d::Zero(), 0, 0.01, 0.5);
  const auto all = fit_rotation(lens, seen.rays, {}, 3);
  ASSERT_TRUE(all);
  EXPECT_NEAR(zoom_instead(*all, Eigen::Vector3d::Zero()).value_or(0), 0.01, 0.002);
  std::erase_if(seen.rays, [](const SeenRay& s) { return s.px.x() < 190; });
  const auto some = fit_rotation(lens, seen.rays, {}, 3);
  ASSERT_TRUE(some);
  EXPECT_LT(std::abs(some->zoom), 5 * some->zoom_sigma);
  const RotationFit turn = without_zoom(*some);
  EXPECT_GT(turn.rotation.dot(turn.covariance.inverse() * turn.rotation), 25);
  EXPECT_NEAR(zoom_instead(*some, Eigen::Vector3d::Zero()).value_or(0), 0.01, 0.003);
}

TEST(RotationFit, ATurnIsNoZoom) {
  const auto lens = camera_in_room().model;
  const Seen seen = seen_by(lens, Eigen::Vector3d(0.005, 0.003, 0), 0);
  const auto fit = fit_rotation(lens, seen.rays, {}, 3);
  ASSERT_TRUE(fit);
  EXPECT_FALSE(zoom_instead(*fit, Eigen::Vector3d::Zero()));
}

TEST(RotationFit, RefusesFewRays) {
  const auto lens = camera_in_room().model;
  const Seen seen = seen_by(lens, Eigen::Vector3d::Zero(), 0);
  EXPECT_FALSE(fit_rotation(lens, std::span(seen.rays).first(3), {}, 2));
}

}  // namespace
}  // namespace huetrack::room_watch
