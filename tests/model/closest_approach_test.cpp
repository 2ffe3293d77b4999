#include "calib/model/closest_approach.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

namespace huetrack::calib {
namespace {

using Eigen::Vector3d;

class ClosestApproachOfRays : public testing::Test {
 protected:
  Vector3d random_vector() { return {normal_(random_), normal_(random_), normal_(random_)}; }
  double positive() { return std::uniform_real_distribution(0.1, 10.0)(random_); }

  std::mt19937 random_{1};
  std::normal_distribution<double> normal_;
};

TEST_F(ClosestApproachOfRays, RecoversTheDistancesToACommonPoint) {
  for (int i = 0; i < 1000; ++i) {
    const Vector3d d0 = random_vector().normalized(), d1 = random_vector().normalized();
    const double s = positive(), t = positive();
    const auto found = closest_approach(s * d0 - t * d1, d0, d1, 0);
    ASSERT_TRUE(found);
    const double tolerance = 1e-13 / found->sin2;
    EXPECT_NEAR(found->along_0, s, tolerance);
    EXPECT_NEAR(found->along_1, t, tolerance);
    EXPECT_NEAR(found->sin2, d0.cross(d1).squaredNorm(), 1e-14);
  }
}

TEST_F(ClosestApproachOfRays, TheJoiningSegmentOfSkewRaysIsPerpendicularToBoth) {
  for (int i = 0; i < 1000; ++i) {
    const Vector3d d0 = random_vector().normalized(), d1 = random_vector().normalized(), base = random_vector();
    const auto found = closest_approach(base, d0, d1, 1e-3);
    if (!found) continue;
    const Vector3d gap = base + found->along_1 * d1 - found->along_0 * d0;
    EXPECT_NEAR(gap.dot(d0), 0, 1e-11);
    EXPECT_NEAR(gap.dot(d1), 0, 1e-11);
    EXPECT_NEAR(gap.norm(), std::abs(base.dot(d0.cross(d1))) / std::sqrt(found->sin2), 1e-11);
  }
}

TEST_F(ClosestApproachOfRays, ExchangingTheRaysExchangesTheDistances) {
  for (int i = 0; i < 100; ++i) {
    const Vector3d d0 = random_vector().normalized(), d1 = random_vector().normalized(), base = random_vector();
    const auto a = closest_approach(base, d0, d1, 0), b = closest_approach(-base, d1, d0, 0);
    EXPECT_EQ(a->along_0, b->along_1);
    EXPECT_EQ(a->along_1, b->along_0);
    EXPECT_EQ(a->sin2, b->sin2);
  }
}

TEST_F(ClosestApproachOfRays, APointBehindAnOriginHasANegativeDistance) {
  const auto found = closest_approach({-1, -1, 0}, Vector3d::UnitX(), Vector3d::UnitY(), 1e-6);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->along_0, -1);
  EXPECT_EQ(found->along_1, 1);
  EXPECT_EQ(found->sin2, 1);
}

TEST_F(ClosestApproachOfRays, NearlyParallelRaysHaveNone) {
  const double angle = 0.01;  // radians
  const Vector3d d1(std::cos(angle), std::sin(angle), 0);
  EXPECT_FALSE(closest_approach(Vector3d::UnitY(), Vector3d::UnitX(), d1, 1.1e-4));
  EXPECT_TRUE(closest_approach(Vector3d::UnitY(), Vector3d::UnitX(), d1, 0.9e-4));
  EXPECT_FALSE(closest_approach(Vector3d::UnitY(), Vector3d::UnitX(), -d1, 1.1e-4));
}

}  // namespace
}  // namespace huetrack::calib
