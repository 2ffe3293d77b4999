#include "camera_tracking/papers/depth_ray.h"

#include <gmock/gmock.h>

#include "particle_filter/random.h"

namespace huetrack::papers {
namespace {

TEST(DepthRay, ConvergesOnOnePeakOnly) {
  const Eigen::Vector3d origin(0, 0, 0), direction(0, 0, 1), truth(0, 0, 0.7);
  particle_filter::Rng rng(8);
  DepthRay ray(origin, direction, 0.2, 5);
  EXPECT_FALSE(ray.converged());
  for (int k = 1; k <= 8; ++k) {
    ray.begin();
    for (int n = 0; n < 40; ++n) {
      const Eigen::Vector3d from(0.02 * k + 0.002 * (rng.uniform() - 0.5), 0.002 * (rng.uniform() - 0.5), 0);
      ray.add(from, (truth - from).normalized(), 1, 0.004);
    }
    EXPECT_TRUE(ray.end());
  }
  const auto depth = ray.converged();
  ASSERT_TRUE(depth);
  EXPECT_NEAR(1 / depth->inverse_depth, 0.7, 0.03);

  DepthRay two(origin, direction, 0.2, 5);  // two places that look alike: not one peak
  for (int k = 1; k <= 8; ++k) {
    two.begin();
    const Eigen::Vector3d from(0.02 * k, 0, 0);
    two.add(from, (truth - from).normalized(), 1, 0.004);
    two.add(from, (Eigen::Vector3d(0, 0, 1.6) - from).normalized(), 1, 0.004);
    two.end();
  }
  EXPECT_FALSE(two.converged());
  DepthRay parallel(origin, direction, 0.2, 5);
  parallel.begin();
  parallel.add({0.001, 0, 0}, direction, 1, 0.004);
  EXPECT_FALSE(parallel.end());
}

}  // namespace
}  // namespace huetrack::papers
