// A rig that is right, and one that is wrong in each of the ways that check_rig() and the self checks name.
#include "calib/solver/rig_check.h"

#include <gtest/gtest.h>

#include "calib/solver/self_check.h"
#include "calib/solver/volume_accuracy.h"
#include "solver/near_truth.h"

namespace huetrack::solver {
namespace {

SyntheticCapture capture_of(int cameras, std::uint64_t seed = 1) {
  return synthetic_capture({.cameras = cameras, .sets = 10, .noise_px = 0.15, .seed = seed});
}

TEST(RigCheck, RigThatIsRightFits) {
  const SyntheticCapture capture = capture_of(3);
  const RigCheck check = check_rig(capture.board, capture.rig, capture.views);
  EXPECT_TRUE(check.moved.empty());
  EXPECT_FALSE(check.scale);
  EXPECT_FALSE(check.swapped);
  EXPECT_FALSE(check.mirrored);
  EXPECT_NEAR(check.as_is_px, check.best_px, 0.03);
  for (const auto& lens : check.lenses) EXPECT_FALSE(lens);
}

TEST(RigCheck, FindsWhichCameraMovedAndByHowMuch) {
  SyntheticCapture capture = capture_of(4);
  const calib::Rigid3d truth = capture.rig.cameras[2].cam_from_world;
  calib::Tangent6d bump;
  bump << 0.02, -0.01, 0.015, 0.03, -0.02, 0.01;
  capture.rig.cameras[2].cam_from_world = calib::exp(bump) * truth;
  const RigCheck check = check_rig(capture.board, capture.rig, capture.views);
  ASSERT_EQ(check.moved.size(), 1u);
  EXPECT_EQ(check.moved[0].camera, 2);
  EXPECT_TRUE(check.alternatives.empty());
  const calib::Tangent6d error = calib::log(truth * calib::inverse(check.moved[0].cam_from_world));
  EXPECT_LT(error.dot(check.moved[0].covariance.ldlt().solve(error)), 30) << "chi-square of 6";
  EXPECT_NEAR(check.moved[0].turned_rad, bump.head<3>().norm(), 0.002);
}

TEST(RigCheck, TwoCamerasCannotSayWhichOfThemMoved) {
  SyntheticCapture capture = capture_of(2);
  capture.rig.cameras[1].cam_from_world.translation += Eigen::Vector3d(0.05, 0.02, 0);
  const RigCheck check = check_rig(capture.board, capture.rig, capture.views);
  EXPECT_EQ(check.moved.size() + check.alternatives.size(), 2u);
}

TEST(RigCheck, NamesAScaleAndSwappedNames) {
  const SyntheticCapture capture = capture_of(3);
  calib::CameraRig scaled = capture.rig;
  for (calib::Camera& camera : scaled.cameras) camera.cam_from_world.translation /= 1.05;
  const RigCheck scale = check_rig(capture.board, scaled, capture.views);
  ASSERT_TRUE(scale.scale);
  EXPECT_NEAR(*scale.scale, 1.05, 0.002);
  EXPECT_TRUE(scale.moved.empty());

  std::vector<BoardView> renamed = capture.views;
  for (BoardView& view : renamed) view.camera = view.camera == 0 ? 2 : view.camera == 2 ? 0 : view.camera;
  const RigCheck swapped = check_rig(capture.board, capture.rig, renamed);
  ASSERT_TRUE(swapped.swapped);
  EXPECT_EQ(*swapped.swapped, std::pair(0, 2));
}

TEST(RigCheck, DoesNotDependOnTheWorldFrame) {
  SyntheticCapture capture = capture_of(3);
  capture.rig.cameras[1].cam_from_world.translation += Eigen::Vector3d(0.04, 0, 0);
  const RigCheck here = check_rig(capture.board, capture.rig, capture.views);
  const calib::Rigid3d move{Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitX())), {1, 2, -3}};
  for (calib::Camera& camera : capture.rig.cameras)
    camera.cam_from_world = camera.cam_from_world * calib::inverse(move);
  const RigCheck there = check_rig(capture.board, capture.rig, capture.views);
  ASSERT_EQ(here.moved.size(), there.moved.size());
  EXPECT_NEAR(here.as_is_px, there.as_is_px, 1e-4);
  for (std::size_t i = 0; i < here.moved.size(); ++i) {
    EXPECT_EQ(here.moved[i].camera, there.moved[i].camera);
    EXPECT_NEAR(here.moved[i].moved_m, there.moved[i].moved_m, 1e-5);
  }
}

TEST(RigCheck, NeedsTwoCamerasThatSawTheBoardTogether) {
  SyntheticCapture capture = capture_of(2);
  for (BoardView& view : capture.views) view.set = 2 * view.set + view.camera;
  EXPECT_THROW(check_rig(capture.board, capture.rig, capture.views), CalibrationError);
  EXPECT_THROW(check_rig(capture.board, capture.rig, {}), CalibrationError);
}

TEST(SelfCheck, HalvesAgreeWhereNothingIsWrong) {
  const SyntheticCapture capture = synthetic_capture({.cameras = 3, .sets = 24, .noise_px = 0.2});
  const auto halves = compare_halves(adjust(near_truth(capture)));
  ASSERT_EQ(halves.size(), 3u);
  for (const HalvesCheck& check : halves) {
    EXPECT_GT(check.expected_m, 0);
    EXPECT_LT(check.ratio(), 2);
    EXPECT_GT(check.ratio(), 0.2);
  }
}

TEST(SelfCheck, WidensTheCovarianceByTheWorstSplitOnlyWhereItIsMoreThanChance) {
  Adjustment a = adjust(near_truth(synthetic_capture({.cameras = 2, .sets = 12})));
  const Eigen::MatrixXd before = a.covariance;
  widen_by(a, {{.seen_m = 1.2e-3, .expected_m = 1e-3}});
  EXPECT_EQ(a.covariance, before);
  widen_by(a, {{.seen_m = 1.2e-3, .expected_m = 1e-3}, {.seen_m = 3e-3, .expected_m = 1e-3}});
  EXPECT_LT((a.covariance - 9 * before).norm(), 1e-9 * before.norm());
}

TEST(SelfCheck, NamesTheCameraThatMovedWithinTheRecordingAndWhen) {
  SyntheticCapture capture = synthetic_capture({.cameras = 3, .sets = 20, .noise_px = 0.15});
  EXPECT_FALSE(find_moved_within(adjust(near_truth(capture))));
  calib::CameraRig later = capture.rig;
  calib::Tangent6d bump;
  bump << 0.004, -0.002, 0.003, 0.004, 0.002, -0.003;
  later.cameras[1].cam_from_world = calib::exp(bump) * later.cameras[1].cam_from_world;
  std::mt19937_64 rng(3);
  for (BoardView& view : capture.views) {
    if (view.camera != 1 || view.set < 11) continue;
    for (std::size_t k = 0; k < view.ids.size(); ++k)
      view.px[k] = later.cameras[1]
                       .project_world(capture.world_from_board[static_cast<std::size_t>(view.set)] *
                                      capture.board.point(view.ids[k]))
                       ->px +
                   0.15 * drawn<2>(rng, normal);
  }
  const auto moved = find_moved_within(adjust(near_truth(capture)));
  ASSERT_TRUE(moved);
  EXPECT_EQ(moved->camera, 1);
  EXPECT_NEAR(moved->set, 11, 1);
  EXPECT_NEAR(moved->turned_rad, bump.head<3>().norm(), 0.002);
  EXPECT_FALSE(moved->is_either_of_two);
}

}  // namespace
}  // namespace huetrack::solver
