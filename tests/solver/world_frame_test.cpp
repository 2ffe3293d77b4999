#include "calib/solver/world_frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "drawn.h"
#include "solver/near_truth.h"
#include "solver/synthetic_rig.h"

namespace huetrack::solver {
namespace {

using Eigen::Vector3d;

const calib::Rigid3d some_motion{Eigen::Quaterniond(Eigen::AngleAxisd(1.1, Vector3d(1, -2, 0.5).normalized())),
                                 {0.5, -2, 3}};

template <typename Call>
Fault fault_of(Call&& call) {
  try {
    call();
  } catch (const CalibrationError& error) {
    EXPECT_STRNE(error.what(), "");
    return error.fault();
  }
  ADD_FAILURE() << "no error";
  return Fault::none;
}

Adjustment adjustment_of(const calib::CameraRig& rig) {
  Adjustment a;
  for (const calib::Camera& camera : rig.cameras) a.cameras.push_back(adjusted_camera(camera));
  return a;
}

TEST(InWorld, ChangesNoPixelAndScalesThePosesUncertainty) {
  calib::CameraRig rig = synthetic_capture({.cameras = 3, .sets = 1}).rig;
  rig.uncertainty = calib::RigUncertainty::of(std::vector(3, calib::RigUncertainty::CameraParameters{.has_pose = true}),
                                              1e-4 * Eigen::MatrixXd::Identity(18, 18));
  const WorldChange change{some_motion, 100};
  const calib::CameraRig moved = in_world(rig, change);
  for (std::size_t c = 0; c < 3; ++c) {
    for (const Vector3d& p : {Vector3d(0, 0, 1), Vector3d(0.3, -0.4, 0.7)}) {
      const auto was = rig.cameras[c].project_world(p), is = moved.cameras[c].project_world(change * p);
      ASSERT_TRUE(was && is);
      EXPECT_LT((was->px - is->px).norm(), 1e-9);
    }
    const int at = rig.uncertainty->cameras[c].pose_at();
    EXPECT_NEAR(moved.uncertainty->sigma(at), rig.uncertainty->sigma(at), 1e-12) << "radians stay";
    EXPECT_NEAR(moved.uncertainty->sigma(at + 3), 100 * rig.uncertainty->sigma(at + 3), 1e-9);
  }
}

TEST(InWorld, MovesBoardsWithTheCameras) {
  Adjustment a = adjustment_of(synthetic_capture({.cameras = 2, .sets = 1}).rig);
  a.world_from_board = {{Eigen::Quaterniond::Identity(), {0, 0, 1}}};
  const Adjustment moved = in_world(a, some_motion);
  for (std::size_t c = 0; c < 2; ++c) {
    const calib::Rigid3d was = a.cameras[c].cam_from_world * a.world_from_board[0];
    const calib::Rigid3d is = moved.cameras[c].cam_from_world * moved.world_from_board[0];
    EXPECT_LT(calib::log(was * calib::inverse(is)).norm(), 1e-12);
  }
}

TEST(AlignPoints, FindsASimilarityAndIsExactForExactPoints) {
  std::vector<Vector3d> from{{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}}, to;
  for (const Vector3d& p : from) to.push_back(2.5 * (some_motion.rotation * p) + some_motion.translation);
  const WorldChange change = align_points(from, to, true);
  EXPECT_NEAR(change.scale, 2.5, 1e-9);
  for (std::size_t i = 0; i < from.size(); ++i) EXPECT_LT((change * from[i] - to[i]).norm(), 1e-9);
  EXPECT_NEAR(align_points(from, to, false).scale, 1, 1e-9);
}

// The best of noisy points: no small change of the result makes the squares smaller.
TEST(AlignPoints, IsTheLeastSquaresSolution) {
  std::mt19937_64 rng(6);
  std::vector<Vector3d> from, to;
  for (int i = 0; i < 8; ++i) {
    from.emplace_back(normal(rng), normal(rng), normal(rng));
    to.push_back(some_motion * from.back() + 0.1 * drawn<3>(rng, normal));
  }
  const WorldChange best = align_points(from, to, false);
  const auto squares = [&](const calib::Rigid3d& pose) {
    double sum = 0;
    for (std::size_t i = 0; i < from.size(); ++i) sum += (pose * from[i] - to[i]).squaredNorm();
    return sum;
  };
  for (int i = 0; i < 6; ++i) {
    for (const double step : {-1e-3, 1e-3}) {
      calib::Tangent6d t = calib::Tangent6d::Zero();
      t(i) = step;
      EXPECT_GT(squares(calib::exp(t) * best.new_from_old), squares(best.new_from_old)) << i;
    }
  }
}

TEST(AlignPoints, RefusesPointsThatLeaveTheWorldFree) {
  const std::vector<Vector3d> line{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}, two{{0, 0, 0}, {1, 0, 0}};
  const std::vector<Vector3d> same(4, Vector3d(1, 2, 3));
  EXPECT_EQ(fault_of([&] { align_points(line, line, true); }), Fault::collinear_points);
  EXPECT_EQ(fault_of([&] { align_points(same, same, true); }), Fault::collinear_points);
  EXPECT_EQ(fault_of([&] { align_points(two, two, true); }), Fault::none);
}

TEST(Floor, FromPointsHasTheCamerasAboveIt) {
  const calib::CameraRig upright = synthetic_capture({.cameras = 3, .sets = 1}).rig;
  const std::vector<Vector3d> points{{0.2, 0.1, 0}, {1, 0.3, 0}, {-0.5, 0.8, 0}, {0, -1, 0}};
  const calib::CameraRig moved = in_world(upright, WorldChange{some_motion, 1});
  std::vector<Vector3d> there;
  for (const Vector3d& p : points) there.push_back(some_motion * p);
  const calib::Rigid3d floor = floor_from_points(there, moved);
  EXPECT_LT((floor * there[0]).norm(), 1e-9) << "the origin";
  EXPECT_NEAR((floor * there[1]).y(), 0, 1e-9) << "x towards the second";
  EXPECT_GT((floor * there[1]).x(), 0);
  for (const Vector3d& p : there) EXPECT_NEAR((floor * p).z(), 0, 1e-9);
  for (const calib::Camera& camera : moved.cameras) EXPECT_NEAR((floor * camera.centre()).z(), 1.8, 1e-9);
}

TEST(Floor, RefusesCamerasOnBothSidesAndPointsInALine) {
  calib::CameraRig rig = synthetic_capture({.cameras = 2, .sets = 1}).rig;
  rig.cameras[1].cam_from_world = looking_at({1, 1, -1.8}, {0, 0, 0});
  EXPECT_EQ(fault_of([&] { floor_from_points({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, rig); }), Fault::undecided_floor);
  EXPECT_EQ(fault_of([&] { floor_from_points({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, rig); }), Fault::collinear_points);
}

TEST(Floor, FromBoardHasItsFrontUp) {
  const calib::Rigid3d floor = floor_from_board(some_motion, 0.01);
  EXPECT_LT((floor * some_motion.translation - Vector3d(0, 0, 0.01)).norm(), 1e-12) << "its point 0, on the surface";
  EXPECT_LT((floor.rotation * (some_motion.rotation * Vector3d::UnitX()) - Vector3d::UnitX()).norm(), 1e-12);
  EXPECT_LT((floor.rotation * (some_motion.rotation * -Vector3d::UnitZ()) - Vector3d::UnitZ()).norm(), 1e-12);
}

TEST(MeasurePoint, IsWhereTheRaysMeet) {
  const calib::CameraRig rig = synthetic_capture({.cameras = 3, .sets = 1}).rig;
  const Vector3d p(0.2, -0.1, 1.2);
  std::vector<std::pair<int, Eigen::Vector2d>> pixels;
  for (int c = 0; c < 3; ++c) pixels.emplace_back(c, rig.cameras[static_cast<std::size_t>(c)].project_world(p)->px);
  EXPECT_LT((measure_point(rig, pixels).p_world - p).norm(), 1e-9);
  EXPECT_LT(measure_point(rig, pixels).rms_px, 1e-6);
  pixels[0].second += Eigen::Vector2d(3, -2);
  EXPECT_GT(measure_point(rig, pixels).rms_px, 0.5);
}

TEST(MeasurePoint, NamesWhatIsMissing) {
  const calib::CameraRig rig = synthetic_capture({.cameras = 2, .sets = 1}).rig;
  const auto what = [&](const std::vector<std::pair<int, Eigen::Vector2d>>& pixels) {
    try {
      measure_point(rig, pixels);
    } catch (const CalibrationError& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(what({{0, {320, 240}}}), testing::HasSubstr("two or more cameras"));
  EXPECT_THAT(what({{0, {320, 240}}, {0, {100, 240}}}), testing::HasSubstr("two or more cameras"));
  // Rays that part in front of the cameras.
  EXPECT_THAT(what({{0, {-3000, 240}}, {1, {3500, 240}}}),
              testing::AnyOf(testing::HasSubstr("do not meet"), testing::HasSubstr("does not reach there")));
}

TEST(KeptWorld, IsThatOfTheCamerasThatStandAsTheyDid) {
  const calib::CameraRig before = synthetic_capture({.cameras = 4, .sets = 1}).rig;
  calib::CameraRig now = in_world(before, WorldChange{some_motion, 1});
  now.cameras[2].cam_from_world.translation += Vector3d(0.4, 0, 0);
  const auto kept = world_of(before, adjustment_of(now));
  ASSERT_TRUE(kept);
  EXPECT_THAT(kept->by, testing::ElementsAre("cam0", "cam1", "cam3"));
  EXPECT_THAT(kept->moved, testing::ElementsAre("cam2"));
  const calib::Rigid3d off = kept->new_from_old * some_motion;
  EXPECT_LT(calib::log(off).norm(), 1e-9);
}

TEST(KeptWorld, NeedsTwoCamerasThatAreInBoth) {
  const calib::CameraRig rig = synthetic_capture({.cameras = 2, .sets = 1}).rig;
  calib::CameraRig other = rig;
  other.cameras[1].name = "another";
  EXPECT_FALSE(world_of(other, adjustment_of(rig)));
}

TEST(UprightGuess, HasUpWhereTheCamerasHaveIt) {
  SyntheticCapture capture = synthetic_capture({.cameras = 4, .sets = 6});
  const calib::CameraRig moved = in_world(capture.rig, WorldChange{some_motion, 1});
  Adjustment a = adjustment_of(moved);
  a.board = capture.board;
  a.views = capture.views;
  for (const calib::Rigid3d& pose : capture.world_from_board) a.world_from_board.push_back(some_motion * pose);
  const calib::Rigid3d guess = upright_guess(a);
  EXPECT_GT((guess.rotation * (some_motion.rotation * Vector3d::UnitZ())).z(), 0.999);
  EXPECT_LT((guess * calib::inverse(a.cameras.front().cam_from_world).translation).x(), -1) << "x away from the first";
}

}  // namespace
}  // namespace huetrack::solver
