#include "calib/model/covariance_ellipse.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace huetrack::calib {
namespace {

TEST(CovarianceEllipse, HasTheAxesOfTheCovariance) {
  const Eigen::Rotation2Dd turn(0.3);
  const Eigen::Matrix2d covariance =
      turn.toRotationMatrix() * Eigen::Vector2d(9, 4).asDiagonal() * turn.toRotationMatrix().transpose();
  const CovarianceEllipse ellipse = ellipse_95(covariance);
  EXPECT_NEAR(ellipse.half_axes[0], 2 * std::sqrt(chi2_95_in_2d), 1e-12);
  EXPECT_NEAR(ellipse.half_axes[1], 3 * std::sqrt(chi2_95_in_2d), 1e-12);
  EXPECT_NEAR(std::abs(ellipse.directions.col(1).dot(turn * Eigen::Vector2d::UnitX())), 1, 1e-12);
  for (const Eigen::Vector2d& p : ellipse.ring(17)) EXPECT_NEAR(p.dot(covariance.inverse() * p), chi2_95_in_2d, 1e-9);
}

TEST(CovarianceEllipse, HasNoExtentWhereThereIsNone) {
  const CovarianceEllipse ellipse = ellipse_95(Eigen::Vector2d(-1, 4).asDiagonal());
  EXPECT_EQ(ellipse.half_axes[0], 0);
  EXPECT_NEAR(ellipse.half_axes[1], 2 * std::sqrt(chi2_95_in_2d), 1e-12);
}

TEST(ChiSquared, OfThreeIsTheSquareOfItsRoot) {
  EXPECT_NEAR(chi_95_in_3d * chi_95_in_3d, chi2_95_in_3d, 1e-3);
}

class Projected : public testing::Test {
 protected:
  Projected() {
    camera_.image_size = {640, 480};
    camera_.model = CameraModel(PinholeRadtan{.fx = 500, .fy = 510, .cx = 320, .cy = 240});
    camera_.cam_from_world = {Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY())), {0.1, 0, 2}};
  }
  Camera camera_;
};

TEST_F(Projected, CovarianceIsWhatAStepInTheWorldDoesToThePixel) {
  const Eigen::Vector3d p(0.1, -0.2, 0.3), step = 1e-6 * Eigen::Vector3d(1, -2, 0.5);
  const Eigen::Vector2d moved = camera_.project_world(p + step)->px - camera_.project_world(p)->px;
  const auto covariance = projected_covariance(camera_, p, step * step.transpose());
  ASSERT_TRUE(covariance.has_value());
  EXPECT_LT((*covariance - moved * moved.transpose()).norm(), 1e-5 * moved.squaredNorm());
}

TEST_F(Projected, CovarianceIsNoneBehindTheCameraOrOfNothing) {
  EXPECT_FALSE(projected_covariance(camera_, {0, 0, -5}, Eigen::Matrix3d::Identity()).has_value());
  EXPECT_FALSE(
      projected_covariance(camera_, {0, 0, 0}, Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN()))
          .has_value());
}

}  // namespace
}  // namespace huetrack::calib
