#include "room_watch/moved_pose.h"

#include <gmock/gmock.h>

#include <random>

#include "drawn.h"
#include "room_watch/filmed_room.h"
#include "room_watch/rotation_fit.h"

namespace huetrack::room_watch {
namespace {

// Rotation by the room of a camera that was turned and shifted, from walls at different distances.
RoomRotation rotation_by_room(const calib::Camera& camera, const Eigen::Vector3d& rotation,
                              const Eigen::Vector3d& shift, std::mt19937& random) {
  std::vector<SeenRay> rays;
  std::normal_distribution<double> noise(0, 0.1);
  std::uniform_real_distribution<double> distance(2.8, 4.6);
  for (int v = 15; v < 180; v += 25) {
    for (int u = 15; u < 240; u += 25) {
      const Eigen::Vector3d ray = camera.model.ray({{u, v}}).value();
      const auto px = camera.model.project(distance(random) * turned(rotation, ray) - shift).value().px;
      rays.push_back({ray, px + drawn<2>(random, noise), 0.1});
    }
  }
  const auto fit = fit_rotation(camera.model, rays, {.rotation = rotation}, 3).value();
  return {fit.rotation, fit.covariance, fit.shift_to_rotation};
}

struct Outcome {
  double turned_off_deg, shift_off_m, nees;
};

Outcome outcome(unsigned seed, bool has_object) {
  const calib::Camera camera = camera_in_room();
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  const auto vector = [&] { return drawn<3>(random, normal); };
  const Eigen::Vector3d rotation = 0.8 * degree * vector().normalized(), shift = 0.004 * vector();
  const calib::Rigid3d truth = moved(camera.cam_from_world, rotation, shift);
  MovedPose pose(camera, 3.6, 0.006);
  pose.set_room(rotation_by_room(camera, rotation, shift, random));
  const Eigen::Vector3d others_off = 0.0015 * vector();
  std::uniform_real_distribution<double> place(-0.8, 0.8);
  for (int k = 0; has_object && k < 120; ++k) {
    const Eigen::Vector3d p = drawn<3>(random, place) + Eigen::Vector3d(0, 0, 1.1);
    const auto px = camera.model.project(truth * p);
    if (!px || !camera.contains(*px)) continue;
    pose.add({.at = capture::Timestamp{capture::duration_of(0.1 * k)},
              .px = px->px + 0.3 * drawn<2>(random, normal),
              .covariance = 0.09 * Eigen::Matrix2d::Identity(),
              .position = p + others_off + 0.002 * vector(),
              .position_covariance = 4e-6 * Eigen::Matrix3d::Identity()});
  }
  const MovedPoseEstimate& found = pose.estimate();
  const calib::Tangent6d off = calib::log(truth * calib::inverse(found.cam_from_world));
  const Eigen::Matrix<double, 6, 6> information = found.covariance.inverse();
  return {(found.rotation - rotation).norm() / degree, (found.shift - shift).norm(), off.dot(information * off)};
}

TEST(MovedPose, RoomAndObjectDetermineRotationAndShift) {
  double nees = 0;
  constexpr int seeds = 30;
  for (unsigned seed = 1; seed <= seeds; ++seed) {
    const Outcome o = outcome(seed, true);
    EXPECT_LT(o.turned_off_deg, 0.1) << seed;
    EXPECT_LT(o.shift_off_m, 0.008) << seed;
    nees += o.nees / seeds;
  }
  EXPECT_GT(nees, 1);  // of 6 degrees of freedom; the priors are wider than what is drawn here
  EXPECT_LT(nees, 9);
}

TEST(MovedPose, TheRoomAloneIsConsistentAboutTheShift) {
  double nees = 0;
  constexpr int seeds = 30;
  for (unsigned seed = 1; seed <= seeds; ++seed) nees += outcome(seed, false).nees / seeds;
  EXPECT_GT(nees, 1.5);
  EXPECT_LT(nees, 9);
}

TEST(MovedPose, AnotherObjectIsGated) {
  const calib::Camera camera = camera_in_room();
  MovedPose pose(camera, 3.6, 0.006);
  std::mt19937 random(1);
  pose.set_room(rotation_by_room(camera, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), random));
  const calib::Rigid3d before = pose.estimate().cam_from_world;
  pose.add({.at = capture::Timestamp{},
            .px = {10, 10},
            .covariance = 0.09 * Eigen::Matrix2d::Identity(),
            .position = {0, 0, 1.1},
            .position_covariance = 1e-6 * Eigen::Matrix3d::Identity()});
  EXPECT_LT(calib::log(pose.estimate().cam_from_world * calib::inverse(before)).norm(), 1e-12);
}

}  // namespace
}  // namespace huetrack::room_watch
