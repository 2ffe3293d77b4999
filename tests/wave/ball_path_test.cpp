#include "calib/wave/ball_path.h"
#include "drawn.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numeric>
#include <random>

namespace huetrack::wave {
namespace {

using Eigen::Vector3d;

BallPath random_path(std::uint64_t seed) {
  BallPath path = BallPath::over(2.0, 3.0, 0.1);
  std::mt19937_64 rng(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (Vector3d& p : path.control) p = drawn<3>(rng, uniform);
  return path;
}

TEST(BallPath, CoversTheTimesThatItIsMadeFor) {
  const BallPath path = BallPath::over(2.0, 3.05, 0.1);
  EXPECT_EQ(path.control.size(), 14u);  // 11 spans and 3
  EXPECT_EQ(path.piece(2.0), 0u);
  EXPECT_EQ(path.piece(3.05), 10u);
  EXPECT_EQ(BallPath::over(1, 1, 0.1).control.size(), 4u) << "of no length: one span";
}

TEST(BallPath, WeightsSumToOneAndTheirDerivativesToZero) {
  const BallPath path = random_path(1);
  for (double t = 1.9; t < 3.1; t += 0.013) {
    const BallPath::Basis basis = path.basis(t, path.piece(t));
    EXPECT_NEAR(std::accumulate(basis.weight.begin(), basis.weight.end(), 0.0), 1, 1e-12) << t;
    EXPECT_NEAR(std::accumulate(basis.weight_per_s.begin(), basis.weight_per_s.end(), 0.0), 0, 1e-9) << t;
  }
}

// A uniform cubic B-spline reproduces straight lines.
TEST(BallPath, ReproducesUniformMotion) {
  BallPath path = BallPath::over(2.0, 3.0, 0.1);
  const Vector3d start(0.3, -1, 2), velocity(0.5, 2, -1);
  for (std::size_t k = 0; k < path.control.size(); ++k)
    path.control[k] = start + velocity * (0.1 * (static_cast<double>(k) - 1));
  for (double t = 2; t <= 3; t += 0.037) {
    EXPECT_LT((path.at(t) - (start + velocity * (t - 2))).norm(), 1e-12) << t;
    EXPECT_LT((path.velocity(t) - velocity).norm(), 1e-9) << t;
  }
}

TEST(BallPath, VelocityAgreesWithDifferences) {
  const BallPath path = random_path(2);
  constexpr double h = 1e-6;
  for (double t = 2.003; t < 3; t += 0.031) {
    const Vector3d difference = (path.at(t + h) - path.at(t - h)) / (2 * h);
    EXPECT_LT((path.velocity(t) - difference).norm(), 1e-6) << t;
  }
}

TEST(BallPath, PositionVelocityAndAccelerationAreContinuousAtKnots) {
  const BallPath path = random_path(3);
  const auto evaluate = [&](double t, std::size_t first) {
    const BallPath::Basis basis = path.basis(t, first);
    Eigen::Matrix<double, 3, 2> out = Eigen::Matrix<double, 3, 2>::Zero();
    for (std::size_t k = 0; k < 4; ++k) {
      out.col(0) += basis.weight[k] * path.control[first + k];
      out.col(1) += basis.weight_per_s[k] * path.control[first + k];
    }
    return out;
  };
  constexpr double h = 1e-6;
  for (std::size_t first = 0; first + 5 <= path.control.size() - 1; ++first) {
    const double knot = path.start_s + path.step_s * static_cast<double>(first + 1);
    EXPECT_LT((evaluate(knot, first) - evaluate(knot, first + 1)).norm(), 1e-9) << knot;
    const Vector3d before = (evaluate(knot, first) - evaluate(knot - h, first)).col(1) / h;
    const Vector3d after = (evaluate(knot + h, first + 1) - evaluate(knot, first + 1)).col(1) / h;
    EXPECT_LT((before - after).norm(), 0.05 + 1e-4 * before.norm()) << knot;
  }
}

// A rigid transform and a scale of the control points are those of the path.
TEST(BallPath, FollowsASimilarityOfItsControlPoints) {
  const BallPath path = random_path(4);
  const Eigen::AngleAxisd turn(0.7, Vector3d(1, 2, -1).normalized());
  const Vector3d shift(3, -2, 0.5);
  constexpr double scale = 2.5;
  BallPath moved = path;
  for (Vector3d& p : moved.control) p = scale * (turn * p) + shift;
  for (double t = 2; t < 3; t += 0.1) {
    EXPECT_LT((moved.at(t) - (scale * (turn * path.at(t)) + shift)).norm(), 1e-12);
    EXPECT_LT((moved.velocity(t) - scale * (turn * path.velocity(t))).norm(), 1e-9);
  }
}

TEST(BallPath, GoesOnWithItsEndPiecesOutside) {
  const BallPath path = random_path(5);
  EXPECT_EQ(path.piece(-100), 0u);
  EXPECT_EQ(path.piece(100), path.control.size() - 4);
  EXPECT_LT((path.at(2.0 - 1e-7) - path.at(2.0)).norm(), 1e-5);
}

}  // namespace
}  // namespace huetrack::wave
