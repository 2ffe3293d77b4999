#include "camera_tracking/papers/unscented_kalman.h"

#include <gmock/gmock.h>

#include <vector>

#include "camera_tracking/drawn_rectangle.h"
#include "particle_filter/random.h"

namespace huetrack::papers {
namespace {

using camera_tracking::camera;
using camera_tracking::look_at;

TEST(FeatureFilter, ConvergesAndRejectsOutliers) {
  const calib::Camera c = camera();
  const Eigen::Vector3d truth(0.05, 0.04, 0.03);
  const calib::Rigid3d first = look_at({0, -0.5, 0.4}, {0, 0, 0});
  const double depth = (first * truth).norm();
  FeatureFilter filter(c.model, first, 1e-8 * Eigen::Matrix<double, 7, 7>::Identity(), 1 / (1.3 * depth), 0.3 / depth,
                       c.model.project(first * truth)->px, 0.25 * Eigen::Matrix2d::Identity());
  const double before = filter.position_covariance().trace();
  particle_filter::Rng rng(9);
  std::vector<float> noise(40);
  rng.fill_normal(noise);
  for (std::size_t k = 0; k < 20; ++k) {
    const calib::Rigid3d pose = look_at({0.01 * static_cast<double>(k + 1), -0.5, 0.4}, {0, 0, 0});
    const Eigen::Vector2d px =
        c.model.project(pose * truth)->px +
        0.3 * Eigen::Vector2d(static_cast<double>(noise[2 * k]), static_cast<double>(noise[2 * k + 1]));
    EXPECT_TRUE(filter.update(pose, px, 0.09 * Eigen::Matrix2d::Identity()));
  }
  EXPECT_LT((*filter.position() - truth).norm(), 0.008);
  EXPECT_LT(filter.position_covariance().trace(), 0.02 * before);
  const calib::Rigid3d pose = look_at({0.3, -0.5, 0.4}, {0, 0, 0});
  EXPECT_FALSE(filter.update(pose, c.model.project(pose * truth)->px + Eigen::Vector2d(40, 0),
                             0.09 * Eigen::Matrix2d::Identity()));
}

}  // namespace
}  // namespace huetrack::papers
