#include "calib/model/rig_uncertainty.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <random>

#include "calib/model/camera_rig.h"
#include "calib/model/rig_history.h"
#include "model/rig_with_errors.h"

namespace huetrack::calib {
namespace {

Camera camera_at(const std::string& name, const Eigen::Vector3d& centre, bool fisheye) {
  const Eigen::Vector3d z = (Eigen::Vector3d(0, 0, 1) - centre).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d r;
  r << x.transpose(), z.cross(x).transpose(), z.transpose();
  CameraModel model{PinholeRadtan{500, 505, 318, 242, {-0.12, 0.03, 1e-3, -5e-4, 0.01}}};
  if (fisheye) model = CameraModel(FisheyeKannalaBrandt{300, 302, 318, 242, {0.02, -0.004, 1e-3, -1e-4}});
  return {name, {640, 480}, model, {Eigen::Quaterniond(r), -r * centre}, {}};
}

CameraRig three_cameras() {
  CameraRig rig;
  rig.cameras = {camera_at("a", {2.5, 0.2, 1.6}, false), camera_at("b", {-1.1, 2.2, 1.9}, true),
                 camera_at("c", {-1.4, -2, 1.2}, false)};
  return rig;
}

const std::vector<RigUncertainty::CameraParameters> of_cameras{
    {.lens_count = 9, .has_pose = true}, {.lens_count = 8, .has_pose = true}, {.has_pose = true}};

// Correlated, and without variance in six directions; lens and pose have the sizes of a good calibration.
Eigen::MatrixXd some_covariance(std::mt19937& rng) {
  std::normal_distribution<double> normal;
  Eigen::VectorXd scale(35);
  const auto pose = [] { return (Eigen::VectorXd(6) << 3e-4, 3e-4, 3e-4, 1e-3, 1e-3, 1e-3).finished(); };
  scale << 0.5, 0.5, 0.5, 0.5, 1e-3, 1e-3, 1e-5, 1e-5, 1e-3, pose(), 0.5, 0.5, 0.5, 0.5, 1e-4, 1e-4, 1e-5, 1e-5, pose(),
      pose();
  const Eigen::MatrixXd root =
      scale.asDiagonal() * Eigen::MatrixXd::NullaryExpr(35, 29, [&] { return normal(rng) / std::sqrt(29.0); });
  return root * root.transpose();
}

TEST(RigUncertainty, StoresASingularCovariance) {
  std::mt19937 rng(1);
  const Eigen::MatrixXd covariance = some_covariance(rng);
  const RigUncertainty uncertainty = RigUncertainty::of(of_cameras, covariance);
  EXPECT_EQ(uncertainty.size(), 35);
  EXPECT_EQ(uncertainty.cameras[2].pose_at(), 29);
  const Eigen::VectorXd sigma = covariance.diagonal().cwiseSqrt();
  const Eigen::MatrixXd off = (uncertainty.covariance() - covariance).array() / (sigma * sigma.transpose()).array();
  EXPECT_LT(off.cwiseAbs().maxCoeff(), 1e-5);
  EXPECT_TRUE(uncertainty
                  .problems([] {
                    CameraRig rig = three_cameras();
                    return rig;
                  }())
                  .empty());
}

// The truth: the pixels of the cameras as they are, and least squares with the cameras as the rig has them.
Eigen::Vector3d triangulated(const CameraRig& truth, const CameraRig& rig, const Eigen::Vector3d& p,
                             const std::vector<PlaceView>& views) {
  Eigen::Vector3d x = p;
  for (int step = 0; step < 10; ++step) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const PlaceView& view : views) {
      const Camera& camera = rig.cameras[static_cast<std::size_t>(view.camera)];
      const auto seen = truth.cameras[static_cast<std::size_t>(view.camera)].project_world(p);
      CameraModel::Jacobian by_cam;
      const auto px = camera.model.project(camera.cam_from_world * x, by_cam);
      const Eigen::Matrix<double, 2, 3> j = by_cam * camera.cam_from_world.rotation.toRotationMatrix();
      normal += j.transpose() * view.information * j;
      right += j.transpose() * view.information * (seen->px - px->px);
    }
    x += normal.ldlt().solve(right);
  }
  return x;
}

TEST(RigUncertainty, PredictsTheEffectOfCameraErrorsOnAPosition) {
  std::mt19937 rng(2);
  std::normal_distribution<double> normal;
  CameraRig rig = three_cameras();
  rig.uncertainty = RigUncertainty::of(of_cameras, some_covariance(rng));
  std::vector<PlaceView> views{{0, Eigen::Matrix2d::Identity()},
                               {1, (Eigen::Matrix2d() << 4, 1, 1, 9).finished()},
                               {2, 2 * Eigen::Matrix2d::Identity()}};
  const Eigen::MatrixXd factor = rig.uncertainty->factor();
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0.3, -0.4, 0.7)}) {
    const Eigen::Matrix3Xd moved = position_gain_of_cameras(rig, *rig.uncertainty, p, views);
    for (int draw = 0; draw < 20; ++draw) {
      const Eigen::VectorXd errors = factor * Eigen::VectorXd::NullaryExpr(factor.cols(), [&] { return normal(rng); });
      // With the true cameras moved by `errors`, the rig's position differs from p by -gain * errors.
      const Eigen::Vector3d off = triangulated(with_errors(rig, errors), rig, p, views) - p;
      EXPECT_LT((off + moved * errors).norm(), 0.02 * off.norm() + 2e-5);
    }
    const Eigen::Matrix3d open = rig_covariance_at(rig, p, views);
    const Eigen::Matrix3d expected = moved * rig.uncertainty->covariance() * moved.transpose();
    EXPECT_LT((open - expected).norm(), 1e-9 * expected.norm());
  }
}

TEST(RigUncertainty, TheSizeInASingleViewGivesItsDepth) {
  std::mt19937 rng(5);
  std::normal_distribution<double> normal;
  CameraRig rig = three_cameras();
  rig.uncertainty = RigUncertainty::of(of_cameras, some_covariance(rng));
  const Eigen::MatrixXd factor = rig.uncertainty->factor();
  const Camera& camera = rig.cameras[0];
  const auto focal = [](const Camera& of) { return std::sqrt(parameters_of(of.model).head<2>().prod()); };
  const Eigen::Vector3d p(0.3, -0.4, 0.7);
  const std::vector<PlaceView> one{{0, Eigen::Matrix2d::Identity(), 400}};
  const Eigen::Matrix3Xd moved = position_gain_of_cameras(rig, *rig.uncertainty, p, one);
  for (int draw = 0; draw < 20; ++draw) {
    const Eigen::VectorXd errors = factor * Eigen::VectorXd::NullaryExpr(factor.cols(), [&] { return normal(rng); });
    const Camera truth = with_errors(rig, errors).cameras[0];
    const double size = focal(truth) / (truth.cam_from_world * p).norm();
    const Eigen::Vector3d seen = *camera.model.ray(*truth.project_world(p)) * focal(camera) / size;
    const Eigen::Vector3d off = inverse(camera.cam_from_world) * seen - p;
    EXPECT_LT((off + moved * errors).norm(), 0.02 * off.norm() + 2e-5);
  }
}

TEST(RigUncertainty, DepthOfASingleViewComesFromThePrior) {
  std::mt19937 rng(3);
  CameraRig rig = three_cameras();
  rig.uncertainty = RigUncertainty::of(of_cameras, some_covariance(rng));
  const std::vector<PlaceView> one{{0, 25 * Eigen::Matrix2d::Identity()}};
  const Eigen::Vector3d p(0, 0, 1), along = (p - rig.cameras[0].centre()).normalized();
  const Eigen::Matrix3d open = rig_covariance_at(rig, p, one, 1e4 * Eigen::Matrix3d::Identity());
  EXPECT_LT(along.dot(open * along), 1e-3 * open.trace());
  EXPECT_GT(open.trace(), 0);
  EXPECT_TRUE(rig_covariance_at(rig, p, {}).isZero());  // no view sees it
  rig.uncertainty.reset();
  EXPECT_TRUE(rig_covariance_at(rig, p, one).isZero());
}

TEST(RigUncertainty, AReplacedPoseHasNoCorrelations) {
  std::mt19937 rng(4);
  CameraRig rig = three_cameras();
  rig.uncertainty = RigUncertainty::of(of_cameras, some_covariance(rng));
  const Eigen::MatrixXd before = rig.uncertainty->covariance();
  const Covariance6d anew = 1e-6 * Covariance6d::Identity();
  const RigUncertainty after = with_pose_covariance(rig, 1, anew);
  ASSERT_EQ(after.size(), 35);
  const Eigen::MatrixXd now = after.covariance();
  EXPECT_LT((now.block(0, 0, 23, 23) - before.block(0, 0, 23, 23)).norm(), 1e-4 * before.norm());
  EXPECT_LT((now.block<6, 6>(23, 23) - anew).norm(), 1e-8);
  EXPECT_LT(now.block(0, 23, 23, 6).norm(), 1e-12);
  rig.uncertainty.reset();
  const RigUncertainty alone = with_pose_covariance(rig, 2, anew);
  EXPECT_EQ(alone.size(), 6);
  EXPECT_EQ(alone.cameras[2].pose_at(), 0);
  EXPECT_FALSE(alone.cameras[0].has_pose);
}

TEST(RigHistory, PrintsTimesAndAges) {
  const auto at = utc_time("2026-11-22T16:04:08Z");
  ASSERT_TRUE(at);
  EXPECT_EQ(at->time_since_epoch().count(), 1795363448);
  EXPECT_EQ(utc_text(*at), "2026-11-22T16:04:08Z");
  for (const char* wrong : {"2026-11-22", "2026-02-30T00:00:00Z", "2026-11-22T25:00:00Z", "2026-11-22T16:04:08Z ", ""})
    EXPECT_FALSE(utc_time(wrong)) << wrong;
  RigHistory made{.at = at, .temperature_c = 21.5, .checks = {}};
  EXPECT_EQ(made.text(*at + std::chrono::hours(50)), "calibrated 2 days ago at 21.5 C");
  for (int k = 0; k < 12; ++k) made.add({*at + std::chrono::hours(k), "usable", std::to_string(k)});
  EXPECT_EQ(made.checks.size(), RigHistory::max_checks);
  EXPECT_EQ(made.checks.back().text, "11");
  EXPECT_EQ(made.text(*at + std::chrono::hours(14)),
            "calibrated 14 hours ago at 21.5 C; last checked 3 hours ago: usable");
  EXPECT_EQ(RigHistory{}.text(*at), "");
}

}  // namespace
}  // namespace huetrack::calib
