// Properties of the pose solver: derivatives, consistency of its covariance, invariances.
#include "camera_tracking/pose_solver.h"

#include <gmock/gmock.h>

#include <Eigen/LU>
#include <algorithm>
#include <numeric>

#include "camera_tracking/random_scene.h"

namespace huetrack::camera_tracking {
namespace {

TEST(PoseJacobian, MatchesDifferences) {
  const calib::CameraModel lens = camera().model;
  RandomScene scene(1);
  for (int run = 0; run < 50; ++run) {
    const calib::Rigid3d pose = scene.pose();
    const Eigen::Vector3d p = scene.point();
    calib::CameraModel::Jacobian j;
    ASSERT_TRUE(lens.project(pose * p, j));
    const Eigen::Matrix<double, 2, 6> analytic = pose_jacobian(j, pose * p);
    constexpr double step = 1e-5;
    for (int axis = 0; axis < 6; ++axis) {
      const calib::Tangent6d xi = step * calib::Tangent6d::Unit(axis);
      const Eigen::Vector2d numeric = (lens.project(calib::exp(xi) * pose * p)->px -
                                       lens.project(calib::exp(calib::Tangent6d(-xi)) * pose * p)->px) /
                                      (2 * step);
      EXPECT_LT((analytic.col(axis) - numeric).norm(), 1e-4 * analytic.norm()) << axis;
    }
  }
}

// Tukey's weights make the information of normal residuals some 15 % too small, the errors 5 % larger.
TEST(RefinePose, CovarianceMatchesMonteCarlo) {
  RandomScene scene(2);
  const calib::Rigid3d truth = scene.pose();
  constexpr int runs = 400;
  double nees = 0;
  Eigen::Matrix<double, 6, 6> sample = Eigen::Matrix<double, 6, 6>::Zero(), predicted = sample;
  RandomScene points(3);
  const std::vector<PoseObservation> exact = points.observe({truth}, 40, 0);
  for (int run = 0; run < runs; ++run) {
    std::vector<PoseObservation> seen = exact;
    for (PoseObservation& o : seen) o.px += o.sigma_px * Eigen::Vector2d(scene.normal(), scene.normal());
    const PoseFit fit = refine_pose(camera().model, seen, calib::exp(scene.tangent(0.01, 0.005)) * truth);
    const calib::Tangent6d error = calib::log(truth * calib::inverse(fit.cam_from_world));
    nees += error.dot(fit.information * error) / runs;
    sample += error * error.transpose() / runs;
    predicted += fit.information.inverse() / runs;
  }
  EXPECT_GT(nees, 4.2);
  EXPECT_LT(nees, 6.6);
  for (int axis = 0; axis < 6; ++axis) {
    EXPECT_GT(sample(axis, axis), 0.65 * predicted(axis, axis)) << axis;
    EXPECT_LT(sample(axis, axis), 1.2 * predicted(axis, axis)) << axis;
  }
}

TEST(RefinePose, ScaleIsTheRatioOfTheSigmas) {
  RandomScene scene(4);
  for (const double stated : {0.25, 0.5, 1.0}) {
    double mean = 0;
    for (int run = 0; run < 20; ++run) {
      const calib::Rigid3d truth = scene.pose();
      std::vector<PoseObservation> seen = scene.observe({truth}, 60, 0.5);
      for (PoseObservation& o : seen) o.sigma_px = stated;
      mean += refine_pose(camera().model, seen, truth).scale / 20;
    }
    EXPECT_NEAR(mean, 0.5 / stated, 0.1 * 0.5 / stated);
  }
}

TEST(RefinePose, SigmasScaleTheInformationOnly) {
  RandomScene scene(5);
  const calib::Rigid3d truth = scene.pose();
  std::vector<PoseObservation> seen = scene.observe({truth}, 40, 0.5);
  const PoseFit fit = refine_pose(camera().model, seen, truth);
  for (PoseObservation& o : seen) o.sigma_px /= 2;
  const PoseFit halved = refine_pose(camera().model, seen, truth);
  EXPECT_LT(distance(fit.cam_from_world, halved.cam_from_world), 1e-9);
  EXPECT_LT((halved.information - 4 * fit.information).norm(), 1e-6 * fit.information.norm());
}

TEST(RefinePose, DoesNotDependOnTheOrder) {
  RandomScene scene(6);
  const calib::Rigid3d truth = scene.pose();
  const std::vector<PoseObservation> seen = scene.observe({truth}, 30, 0.5);
  std::vector<std::size_t> order(seen.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::shuffle(order, scene.random());
  std::vector<PoseObservation> shuffled;
  for (const std::size_t i : order) shuffled.push_back(seen[i]);
  const PoseFit a = refine_pose(camera().model, seen, truth), b = refine_pose(camera().model, shuffled, truth);
  EXPECT_LT(distance(a.cam_from_world, b.cam_from_world), 1e-10);
  for (std::size_t i = 0; i < order.size(); ++i) EXPECT_NEAR(a.weight[order[i]], b.weight[i], 1e-7);
}

TEST(RefinePose, EquivariantToTheWorldFrame) {
  RandomScene scene(7);
  for (int run = 0; run < 10; ++run) {
    const calib::Rigid3d truth = scene.pose(), start = calib::exp(scene.tangent(0.02, 0.01)) * truth;
    const std::vector<PoseObservation> seen = scene.observe({truth}, 25, 0.5);
    const calib::Rigid3d new_from_old = scene.transform(), old_from_new = calib::inverse(new_from_old);
    const PoseFit a = refine_pose(camera().model, seen, start),
                  b = refine_pose(camera().model, moved(seen, new_from_old), start * old_from_new);
    EXPECT_LT(distance(a.cam_from_world * old_from_new, b.cam_from_world), 1e-8);
    EXPECT_LT((a.information - b.information).norm(), 1e-6 * a.information.norm());
    // Errors of the world_from_camera turn with the world.
    Eigen::Matrix<double, 6, 6> turn = Eigen::Matrix<double, 6, 6>::Zero();
    turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = new_from_old.rotation.toRotationMatrix();
    const Covariance6d expected = turn * world_covariance(a.cam_from_world, tangent_covariance(a)) * turn.transpose();
    EXPECT_LT((world_covariance(b.cam_from_world, tangent_covariance(b)) - expected).norm(), 1e-6 * expected.norm());
  }
}

TEST(RefinePose, EquivariantToTheUnitOfLength) {
  RandomScene scene(8);
  for (const double s : {0.1, 10.0}) {
    const calib::Rigid3d truth = scene.pose(), start = calib::exp(scene.tangent(0.02, 0.01)) * truth;
    const std::vector<PoseObservation> seen = scene.observe({truth}, 25, 0.5);
    const PoseFit a = refine_pose(camera().model, seen, start),
                  b = refine_pose(camera().model, scaled(seen, s), scaled(start, s));
    EXPECT_LT(distance(scaled(a.cam_from_world, s), b.cam_from_world), 1e-6 * s);
    const Eigen::Matrix<double, 6, 6> expected = unit_change(1 / s) * a.information * unit_change(1 / s);
    EXPECT_LT((b.information - expected).norm(), 1e-4 * expected.norm());
    EXPECT_NEAR(position_sigma_m(b), s * position_sigma_m(a), 1e-3 * s * position_sigma_m(a));
  }
}

TEST(RefinePose, OutliersHaveNoInfluence) {
  RandomScene scene(9);
  const calib::Rigid3d truth = scene.pose();
  std::vector<PoseObservation> seen = scene.observe({truth}, 40, 0.5);
  for (std::size_t i = 0; i < 8; ++i) seen[5 * i].px += Eigen::Vector2d(25, -20);
  const PoseFit fit = refine_pose(camera().model, seen, truth);
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_EQ(fit.weight[5 * i], 0);
    seen[5 * i].px += Eigen::Vector2d(40, 30);
  }
  EXPECT_LT(distance(refine_pose(camera().model, seen, truth).cam_from_world, fit.cam_from_world), 1e-7);
}

TEST(SolvePose, NeedsNoStart) {
  RandomScene scene(10);
  for (int run = 0; run < 40; ++run) {
    const calib::Rigid3d truth = scene.pose();
    std::vector<PoseObservation> seen = scene.observe({truth}, 12, 0);
    if (run % 2 == 0) {  // in a plane
      for (PoseObservation& o : seen) {
        o.p_world.z() = 0;
        o.px = camera().model.project(truth * o.p_world)->px;
      }
    }
    const auto fit = solve_pose(camera().model, seen);
    ASSERT_TRUE(fit) << run;
    EXPECT_LT(distance(fit->cam_from_world, truth), 1e-4) << run;
  }
}

TEST(SolvePoseRansac, IsDeterministicForASeed) {
  RandomScene scene(11);
  const calib::Rigid3d truth = scene.pose();
  std::vector<PoseObservation> seen = scene.observe({truth}, 60, 0.5);
  for (std::size_t i = 0; i < seen.size(); i += 2) seen[i].px = {scene.uniform(0, 320), scene.uniform(0, 240)};
  const auto a = solve_pose_ransac(camera().model, seen, 3, 15, 7),
             b = solve_pose_ransac(camera().model, seen, 3, 15, 7);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->cam_from_world.translation, b->cam_from_world.translation);
  EXPECT_LT(distance(a->cam_from_world, truth), 0.02);
}

// ---- The poses of a rolling shutter's rows

SweptPose random_sweep(RandomScene& scene) {
  return {scene.pose(), {scene.tangent(0.04, 0.01), scene.tangent(0.01, 0.003), 239}};
}

TEST(Sweep, RowsFollowTheTrajectory) {
  RandomScene scene(12);
  for (int run = 0; run < 20; ++run) {
    const calib::Tangent6d velocity = scene.tangent(1.5, 0.5), acceleration = scene.tangent(4, 2);
    const double readout_s = scene.uniform(-0.03, 0.03);
    const SweptPose pose{scene.pose(), {readout_s * velocity, readout_s * readout_s * acceleration, 239}};
    for (const double row : {0.0, 60.0, 119.5, 200.0, 239.0}) {
      const double t = readout_s * (row / 239 - 0.5);
      const calib::Rigid3d expected =
          calib::exp(calib::Tangent6d(t * velocity + 0.5 * t * t * acceleration)) * pose.cam_from_world;
      EXPECT_LT(distance(pose.at(row), expected), 1e-12) << row;
    }
  }
}

TEST(Sweep, FractionIsLinearAndClamped) {
  const Sweep sweep{calib::Tangent6d::Zero(), calib::Tangent6d::Zero(), 239};
  EXPECT_EQ(sweep.fraction(0), -0.5);
  EXPECT_EQ(sweep.fraction(119.5), 0);
  EXPECT_EQ(sweep.fraction(239), 0.5);
  EXPECT_EQ(sweep.fraction(1e6), 0.75);
  EXPECT_EQ(sweep.fraction(-1e6), -0.75);
}

TEST(ProjectSwept, PixelAndRowAreConsistent) {
  RandomScene scene(13);
  double most_px = 0;
  for (int run = 0; run < 300; ++run) {
    const SweptPose pose = random_sweep(scene);
    const Eigen::Vector3d p = scene.point();
    const auto seen = project_swept(camera().model, pose, p);
    ASSERT_TRUE(seen);
    EXPECT_LT((camera().model.project(pose.at(seen->px.y()) * p)->px - seen->px).norm(), 0.02);
    most_px = std::max(most_px, (camera().model.project(pose.cam_from_world * p)->px - seen->px).norm());
  }
  EXPECT_GT(most_px, 3);  // of the middle row's pose: the test can fail
}

TEST(ProjectSwept, WithoutASweepItIsAGlobalShutter) {
  RandomScene scene(14);
  const SweptPose pose{scene.pose()};
  const Eigen::Vector3d p = scene.point();
  EXPECT_EQ(project_swept(camera().model, pose, p)->px, camera().model.project(pose.cam_from_world * p)->px);
  EXPECT_FALSE(project_swept(camera().model, pose, calib::inverse(pose.cam_from_world) * Eigen::Vector3d(0, 0, -1)));
}

TEST(Sweep, UnskewMatchesDifferences) {
  RandomScene scene(15);
  double most_skew = 0;
  for (int run = 0; run < 60; ++run) {
    const SweptPose pose = random_sweep(scene);
    const Eigen::Vector3d p = scene.point();
    const SweptPixel centre = *project_swept(camera().model, pose, p);
    calib::CameraModel::Jacobian j;
    ASSERT_TRUE(camera().model.project(centre.cam_from_world * p, j));
    const Eigen::Matrix2d unskew = pose.sweep.unskew(j, centre.cam_from_world * p, centre.px.y());
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d q = p + 0.01 * Eigen::Vector3d::Unit(axis);
      const Eigen::Vector2d as_exposed = project_swept(camera().model, pose, q)->px - centre.px,
                            at_one_time = camera().model.project(centre.cam_from_world * q)->px - centre.px;
      EXPECT_LT((unskew * as_exposed - at_one_time).norm(), 0.03) << run;
      most_skew = std::max(most_skew, (as_exposed - at_one_time).norm());
    }
  }
  EXPECT_GT(most_skew, 0.3);
}

}  // namespace
}  // namespace huetrack::camera_tracking
