#include "calib/wave/similarity.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "wave/waving.h"

namespace huetrack::wave {
namespace {

using Eigen::Vector3d;

const Similarity some_similarity{.scale = 1.7,
                                 .rotation = Eigen::AngleAxisd(0.9, Vector3d(1, -2, 0.5).normalized()).matrix(),
                                 .translation = {0.4, -3, 1.1}};

WaveState state_of(const calib::CameraRig& rig) {
  WaveState state;
  for (const calib::Camera& camera : rig.cameras) state.cam_from_world.push_back(camera.cam_from_world);
  state.path = BallPath::over(0, 1, 0.1);
  for (std::size_t k = 0; k < state.path.control.size(); ++k) state.path.control[k] = lissajous(0.1 * double(k));
  return state;
}

TEST(Similarity, ChangesNoPixel) {
  const calib::CameraRig rig = rig_of(3);
  const WaveState before = state_of(rig);
  WaveState after = before;
  some_similarity.apply(after);
  for (std::size_t c = 0; c < 3; ++c) {
    for (double t = 0; t < 1; t += 0.13) {
      const Vector3d was = before.cam_from_world[c] * before.path.at(t);
      const Vector3d is = after.cam_from_world[c] * after.path.at(t);
      EXPECT_LT((is - some_similarity.scale * was).norm(), 1e-9);
    }
  }
}

TEST(Similarity, OntoRigUndoesAChangeOfWorldAndScale) {
  const calib::CameraRig rig = rig_of(4);
  WaveState state = state_of(rig);
  some_similarity.apply(state);
  const Similarity back = onto_rig(rig, state, true);
  EXPECT_NEAR(back.scale, 1 / some_similarity.scale, 1e-9);
  back.apply(state);
  for (std::size_t c = 0; c < 4; ++c)
    EXPECT_LT((calib::inverse(state.cam_from_world[c]).translation - rig.cameras[c].centre()).norm(), 1e-9);
}

TEST(Similarity, OntoRigLeavesTheScaleWhereItIsKnown) {
  const calib::CameraRig rig = rig_of(3);
  WaveState state = state_of(rig);
  some_similarity.apply(state);
  EXPECT_EQ(onto_rig(rig, state, false).scale, 1);
}

TEST(Similarity, OntoRigFollowsTheCamerasThatDidNotMove) {
  const calib::CameraRig rig = rig_of(5);
  WaveState state = state_of(rig);
  state.cam_from_world[1].translation += Vector3d(0.5, 0.2, -0.3);  // was bumped
  onto_rig(rig, state, true).apply(state);
  for (const std::size_t c : {0, 2, 3, 4})
    EXPECT_LT((calib::inverse(state.cam_from_world[c]).translation - rig.cameras[c].centre()).norm(), 0.01) << c;
  EXPECT_GT((calib::inverse(state.cam_from_world[1]).translation - rig.cameras[1].centre()).norm(), 0.5);
}

TEST(Similarity, OntoRigDoesNotDependOnTheOrderOfCameras) {
  calib::CameraRig rig = spoilt(rig_of(4), 0.05, 1);
  const WaveState state = state_of(rig_of(4));
  const Similarity once = onto_rig(rig, state, true);
  std::ranges::reverse(rig.cameras);
  WaveState reversed = state;
  std::ranges::reverse(reversed.cam_from_world);
  const Similarity again = onto_rig(rig, reversed, true);
  EXPECT_NEAR(once.scale, again.scale, 1e-9);
  EXPECT_LT((once.rotation - again.rotation).norm(), 1e-9);
  EXPECT_LT((once.translation - again.translation).norm(), 1e-9);
}

TEST(Similarity, OntoPointsFindsTheRigidMotionAndKeepsTheScale) {
  std::vector<Vector3d> from, to;
  for (int i = 0; i < 6; ++i) {
    from.push_back(lissajous(0.7 * i));
    to.push_back(some_similarity.rotation * from.back() + some_similarity.translation);
  }
  const Similarity found = onto_points(from, to);
  EXPECT_NEAR(found.scale, 1, 1e-9);
  for (std::size_t i = 0; i < from.size(); ++i) EXPECT_LT((found * from[i] - to[i]).norm(), 1e-9);
}

// What light from one side does: all cameras' poses are found a little off. One camera of the rig was moved since.
TEST(Similarity, OntoViewsKeepsThePositionsOfTheRig) {
  constexpr double radius_m = 0.04;
  const calib::CameraRig truth = rig_of(4);
  WaveState state = state_of(truth);
  std::vector<BallObservation> seen;
  for (int c = 0; c < 4; ++c) {
    for (double t = 0; t < 1; t += 0.02) {
      const calib::Camera& camera = truth.cameras[std::size_t(c)];
      const auto px = outline_centre(camera.model, camera.cam_from_world * state.path.at(t), radius_m);
      ASSERT_TRUE(px);
      seen.push_back({c, t, *px, Eigen::Matrix2d::Identity()});
    }
  }
  calib::CameraRig rig = truth;
  rig.cameras[2].cam_from_world.translation += Vector3d(0.1, 0.05, 0);
  const WaveState before = state;
  state.cam_from_world.clear();
  for (const calib::Camera& camera : spoilt(truth, 0.02, 0.3).cameras)
    state.cam_from_world.push_back(camera.cam_from_world);
  Similarity motion = some_similarity;
  motion.scale = 1;
  motion.apply(state);
  const auto worst = [&](const Similarity& back) {
    double metres = 0;
    for (double t = 0; t < 1; t += 0.1) metres = std::max(metres, (back * state.path.at(t) - before.path.at(t)).norm());
    return metres;
  };
  const Similarity by_poses = onto_rig(rig, state, false);
  EXPECT_GT(worst(by_poses), 0.005);
  EXPECT_LT(worst(onto_views(rig, state, seen, radius_m, by_poses)), 0.002);
}

}  // namespace
}  // namespace huetrack::wave
