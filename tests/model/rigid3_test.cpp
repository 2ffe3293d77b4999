#include "calib/model/rigid3.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace huetrack::calib {
namespace {

constexpr double half_turn = std::numbers::pi;

double random_1(std::mt19937_64& rng) {
  return static_cast<double>(rng() >> 11) * 0x1p-53 * 2 - 1;
}

Eigen::Vector3d random_vector(std::mt19937_64& rng) {
  return {random_1(rng), random_1(rng), random_1(rng)};
}

Eigen::Matrix4d matrix(const Rigid3d& t) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = t.rotation.toRotationMatrix();
  m.topRightCorner<3, 1>() = t.translation;
  return m;
}

// The definition: the exponential series of the 4x4 twist matrix, by scaling and squaring.
Eigen::Matrix4d exponential_series(const Tangent6d& tangent) {
  Eigen::Matrix4d twist = Eigen::Matrix4d::Zero();
  const Eigen::Vector3d w = tangent.head<3>();
  twist.topLeftCorner<3, 3>() << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  twist.topRightCorner<3, 1>() = tangent.tail<3>();
  twist /= 64;
  Eigen::Matrix4d sum = Eigen::Matrix4d::Identity(), term = sum;
  for (int n = 1; n < 20; ++n) sum += term = term * twist / n;
  for (int i = 0; i < 6; ++i) sum = sum * sum;
  return sum;
}

// Angles at both ends of the closed forms, and at the border to their series.
const std::vector<double> angles{
    0,        1e-300, 1e-12, 1e-8, 1e-5,          9.99e-4,          1.0e-3,           1.001e-3,
    1.999e-3, 2e-3,   0.1,   1,    half_turn / 2, half_turn - 1e-3, half_turn - 1e-6, half_turn - 1e-9,
    half_turn};

TEST(Rigid3, ComposeAndInverseAreThoseOfMatrices) {
  std::mt19937_64 rng(1);
  for (int i = 0; i < 100; ++i) {
    const Rigid3d a_from_b{Eigen::Quaterniond(random_1(rng), random_1(rng), random_1(rng), random_1(rng)).normalized(),
                           random_vector(rng)};
    const Rigid3d b_from_c{Eigen::Quaterniond(random_1(rng), random_1(rng), random_1(rng), random_1(rng)).normalized(),
                           random_vector(rng)};
    EXPECT_LT((matrix(a_from_b * b_from_c) - matrix(a_from_b) * matrix(b_from_c)).norm(), 1e-14);
    EXPECT_LT((matrix(inverse(a_from_b)) - matrix(a_from_b).inverse()).norm(), 1e-14);
    const Eigen::Vector3d p = random_vector(rng);
    EXPECT_LT((inverse(a_from_b) * (a_from_b * p) - p).norm(), 1e-14);
  }
}

TEST(Rigid3, ExpIsTheExponentialSeries) {
  std::mt19937_64 rng(2);
  for (const double angle : angles) {
    for (int i = 0; i < 20; ++i) {
      Tangent6d tangent;
      tangent << random_vector(rng).normalized() * angle, random_vector(rng) * 3;
      const Rigid3d t = exp(tangent);
      EXPECT_LT((matrix(t) - exponential_series(tangent)).norm(), 2e-13) << angle;
      EXPECT_NEAR(t.rotation.norm(), 1, 1e-15);
    }
  }
}

TEST(Rigid3, LogUndoesExp) {
  std::mt19937_64 rng(3);
  for (const double angle : angles) {
    for (int i = 0; i < 20; ++i) {
      Tangent6d tangent;
      tangent << random_vector(rng).normalized() * angle, random_vector(rng) * 3;
      const Tangent6d back = log(exp(tangent));
      // At pi both axes are the same rotation; and the pose must be the same in any case.
      if (angle < half_turn - 1e-8) {
        EXPECT_LT((back - tangent).norm(), 1e-13) << angle;
      }
      EXPECT_LT((matrix(exp(back)) - matrix(exp(tangent))).norm(), 1e-13) << angle;
      EXPECT_LE(back.head<3>().norm(), half_turn + 1e-15) << angle;
      if (angle > 1e-299) {
        EXPECT_NEAR(back.head<3>().norm() / angle, 1, 1e-12);
      }
    }
  }
}

TEST(Rigid3, LogOfQAndMinusQIsTheSame) {
  const Rigid3d t{Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY())), {1, 2, 3}};
  const Rigid3d same{Eigen::Quaterniond(-t.rotation.coeffs()), t.translation};
  EXPECT_LT((log(t) - log(same)).norm(), 1e-15);
  EXPECT_NEAR(log(same).head<3>().norm(), 0.3, 1e-15);
}

TEST(Rigid3, TinyTranslationsSurvive) {
  Tangent6d tangent;
  tangent << 1e-10, -2e-10, 3e-10, 4e-10, -5e-10, 6e-10;
  EXPECT_LT((log(exp(tangent)) - tangent).norm(), 1e-24);
}

}  // namespace
}  // namespace huetrack::calib
