#include "calib/wave/outline_cost.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <array>
#include <numbers>

#include "wave/waving.h"

namespace huetrack::wave {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double ball_m = 0.04;

calib::Camera fisheye_camera() {
  calib::Camera camera = rig_of(1).cameras.front();
  camera.model = calib::CameraModel(calib::FisheyeKannalaBrandt{310, 312, 321, 239, {0.05, -0.01, 0.003, -0.001}});
  return camera;
}

// The values of the blocks of one cost, and pointers to them.
struct Blocks {
  std::array<double, 6> pose{};
  std::array<std::array<double, 3>, 4> control{};
  double latency_s = 0.004, readout_s = 0.02;
  LensChange lens{{0.03, 4, -3, 0.05, -0.02, 0.001, -0.002}};

  std::array<double*, 8> pointers() {
    return {pose.data(),       control[0].data(), control[1].data(), control[2].data(),
            control[3].data(), &latency_s,        &readout_s,        lens.data()};
  }
};

struct Case {
  calib::Camera camera;
  BallPath path = BallPath::over(0, 1, 0.1);
  BallObservation observation;
  Blocks blocks;

  explicit Case(calib::Camera of, double omega) : camera(std::move(of)) {
    observation = {0, 0.52, {300, 260}, (Eigen::Matrix2d() << 0.04, 0.01, 0.01, 0.09).finished()};
    for (std::size_t k = 0; k < 4; ++k) {
      const Vector3d p = lissajous(0.1 * (static_cast<double>(k) + 4));
      std::copy_n(p.data(), 3, blocks.control[k].begin());
    }
    const Vector3d t = camera.cam_from_world.translation;
    blocks.pose = {0.7 * omega, -0.4 * omega, 0.5 * omega, t.x(), t.y(), t.z()};
  }
  std::unique_ptr<ceres::CostFunction> cost() const {
    return outline_cost(camera, camera.cam_from_world.rotation.toRotationMatrix(), observation, -0.2, path, 5, ball_m);
  }
};

TEST(OutlineCost, JacobiansAgreeWithDifferences) {
  for (const calib::Camera& camera : {rig_of(1).cameras.front(), fisheye_camera()}) {
    for (const double omega : {0.0, 1e-9, 0.05, 0.6}) {
      Case c(camera, omega);
      const auto cost = c.cost();
      const auto blocks = c.blocks.pointers();
      const auto& sizes = cost->parameter_block_sizes();
      std::array<std::vector<double>, 8> jacobian;
      std::array<double*, 8> jacobians;
      for (std::size_t b = 0; b < 8; ++b) {
        jacobian[b].resize(2 * static_cast<std::size_t>(sizes[b]));
        jacobians[b] = jacobian[b].data();
      }
      Vector2d residual;
      ASSERT_TRUE(cost->Evaluate(blocks.data(), residual.data(), jacobians.data()));
      for (std::size_t b = 0; b < 8; ++b) {
        for (int i = 0; i < sizes[b]; ++i) {
          constexpr double h = 1e-6;
          const double was = blocks[b][i];
          Vector2d more, less;
          blocks[b][i] = was + h;
          ASSERT_TRUE(cost->Evaluate(blocks.data(), more.data(), nullptr));
          blocks[b][i] = was - h;
          ASSERT_TRUE(cost->Evaluate(blocks.data(), less.data(), nullptr));
          blocks[b][i] = was;
          const Vector2d difference = (more - less) / (2 * h);
          const Vector2d analytic(jacobian[b][static_cast<std::size_t>(i)],
                                  jacobian[b][static_cast<std::size_t>(sizes[b] + i)]);
          EXPECT_LT((analytic - difference).norm(), 1e-3 + 1e-5 * difference.norm())
              << "block " << b << ", parameter " << i << ", turned by " << omega;
        }
      }
    }
  }
}

TEST(OutlineCost, ResidualIsWhitenedPredictedMinusMeasured) {
  Case c(rig_of(1).cameras.front(), 0);
  const auto blocks = c.blocks.pointers();
  const BallPath::Basis basis = c.path.basis(0.52 - c.blocks.latency_s - 0.2 * c.blocks.readout_s, 5);
  Vector3d p = Vector3d::Zero();
  for (std::size_t k = 0; k < 4; ++k) p += basis.weight[k] * Eigen::Map<Vector3d>(c.blocks.control[k].data());
  const auto px = outline_centre(changed(c.camera.model, c.blocks.lens), c.camera.cam_from_world * p, ball_m);
  ASSERT_TRUE(px);
  const Vector2d off = *px - c.observation.px;
  Vector2d residual;
  ASSERT_TRUE(c.cost()->Evaluate(blocks.data(), residual.data(), nullptr));
  EXPECT_NEAR(residual.squaredNorm(), off.dot(c.observation.covariance.inverse() * off), 1e-6 * residual.squaredNorm());
}

TEST(OutlineCost, BallBehindTheCameraIsAnOutlierWithoutSlope) {
  Case c(rig_of(1).cameras.front(), 0);
  c.blocks.pose[5] -= 20;  // the camera has passed it
  const auto blocks = c.blocks.pointers();
  std::array<double, 12> by_pose;
  std::array<double*, 8> jacobians{by_pose.data()};
  Vector2d residual;
  ASSERT_TRUE(c.cost()->Evaluate(blocks.data(), residual.data(), jacobians.data()));
  EXPECT_GT(residual.norm(), 1e3);
  for (const double slope : by_pose) EXPECT_EQ(slope, 0);
}

TEST(OutlineCost, RightJacobianOfTheRotation) {
  for (const double angle : {0.0, 1e-8, 1e-3, 0.4, 2.5}) {
    const Vector3d omega = angle * Vector3d(1, -2, 0.5).normalized();
    const Eigen::Matrix3d j = right_jacobian(omega);
    for (int i = 0; i < 3; ++i) {
      constexpr double h = 1e-6;
      const Eigen::AngleAxisd difference(Eigen::Matrix3d(rotation_of(omega - h * Vector3d::Unit(i)).transpose() *
                                                         rotation_of(omega + h * Vector3d::Unit(i))));
      EXPECT_LT((difference.angle() * difference.axis() / (2 * h) - j.col(i)).norm(), 1e-5) << angle;
    }
  }
}

// Against the silhouette itself: points of the sphere where the line of sight is tangent.
TEST(OutlineCentre, IsTheMiddleOfTheSilhouette) {
  const calib::CameraModel pinhole(calib::PinholeRadtan{500, 500, 320, 240, {}});
  for (const Vector3d& p : {Vector3d(0.5, 0.3, 1), Vector3d(-0.4, 0.2, 0.6), Vector3d(0, 0, 1)}) {
    constexpr double radius_m = 0.1;  // large and near, so that the offset is clear
    const double distance = p.norm(), sine = radius_m / distance, cosine = std::sqrt(1 - sine * sine);
    const Vector3d ahead = p / distance, aside = ahead.unitOrthogonal(), below = ahead.cross(aside);
    // The centre of an ellipse is the mean of where it begins and ends along each axis.
    Vector2d low = Vector2d::Constant(1e9), high = -low;
    for (int i = 0; i < 20000; ++i) {
      const double angle = 2 * std::numbers::pi * i / 20000;
      const auto px = pinhole.project(cosine * ahead + sine * (std::cos(angle) * aside + std::sin(angle) * below));
      ASSERT_TRUE(px);
      low = low.cwiseMin(px->px), high = high.cwiseMax(px->px);
    }
    const auto centre = outline_centre(pinhole, p, radius_m);
    ASSERT_TRUE(centre);
    EXPECT_LT((*centre - (low + high) / 2).norm(), 1e-3);
    if (p.x() != 0) {
      EXPECT_GT((*centre - pinhole.project(p)->px).norm(), 0.5) << "which the centre's projection is not";
    }
  }
}

TEST(OutlineCentre, IsNoneBehindTheCamera) {
  EXPECT_FALSE(outline_centre(rig_of(1).cameras.front().model, {0, 0, -1}, ball_m));
}

}  // namespace
}  // namespace huetrack::wave
