#include "outline/normal_equations.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <random>

namespace huetrack::outline {
namespace {

Normal some_information() {
  Normal slopes = Normal::Zero();
  for (int i = 0; i < unknowns; ++i)
    for (int k = 0; k < unknowns; ++k) slopes(i, k) = std::sin(1.7 * i + 0.9 * k + 0.3 * i * k);
  return slopes * slopes.transpose() + Normal::Identity();
}

TEST(NormalEquations, CovarianceIsABlockOfTheInverse) {
  const Normal normal = some_information(), information = 0.5 * Normal::Identity();
  NormalEquations<unknowns, reported_unknowns> equations;
  equations.eliminate(normal, information);
  ASSERT_TRUE(equations.is_sound());
  const Normal inverse = (normal + information).inverse();
  EXPECT_TRUE(equations.covariance().isApprox(inverse.topLeftCorner<reported_unknowns, reported_unknowns>(), 1e-9));
  EXPECT_TRUE(equations.covariance_of_light().isApprox(inverse.block<lights, lights>(shading_, shading_), 1e-9));
  const Unknowns right = Unknowns::LinSpaced(-1, 2);
  Unknowns solution;
  equations.solve(right, solution);
  EXPECT_TRUE(solution.isApprox(inverse * right, 1e-9));
}

TEST(NormalEquations, SolvesHeldUnknowns) {
  const HeldNormal normal = some_information().topLeftCorner<held_count, held_count>();
  NormalEquations<held_count, placed> equations;
  equations.eliminate(normal, HeldNormal::Identity());
  ASSERT_TRUE(equations.is_sound());
  const HeldNormal inverse = (normal + HeldNormal::Identity()).inverse();
  EXPECT_TRUE(equations.covariance().isApprox(inverse.topLeftCorner<placed, placed>(), 1e-9));
  const HeldUnknowns right = HeldUnknowns::LinSpaced(-1, 2);
  HeldUnknowns solution;
  equations.solve(right, solution);
  EXPECT_TRUE(solution.isApprox(inverse * right, 1e-9));
  equations.eliminate(-normal, HeldNormal::Zero());
  EXPECT_FALSE(equations.is_sound());
}

TEST(NormalEquations, InvertsLightMatrices) {
  const LightMatrix matrix = some_information().topLeftCorner<lights, lights>();
  const auto inverse = inverse_of(matrix);
  ASSERT_TRUE(inverse);
  EXPECT_TRUE(inverse->isApprox(matrix.inverse(), 1e-9));
  EXPECT_FALSE(inverse_of(-matrix));
}

// Scales of the unknowns differ by up to four decades, as pixels and seconds do.
template <int size>
Eigen::Matrix<double, size, size> random_information(std::mt19937& rng) {
  std::normal_distribution<double> normal(0, 1);
  std::uniform_real_distribution<double> decades(-2, 2);
  Eigen::Matrix<double, size, size> slopes;
  for (int i = 0; i < size; ++i)
    for (int k = 0; k < size; ++k) slopes(i, k) = normal(rng);
  Eigen::Matrix<double, size, 1> scale;
  for (int i = 0; i < size; ++i) scale[i] = std::pow(10, decades(rng));
  return scale.asDiagonal() * (slopes * slopes.transpose() + 0.01 * Eigen::Matrix<double, size, size>::Identity()) *
         scale.asDiagonal();
}

template <int size, int reported>
void compare_with_eigen(unsigned seed) {
  std::mt19937 rng(seed);
  using Matrix = Eigen::Matrix<double, size, size>;
  const Matrix normal = random_information<size>(rng);
  const Matrix information = random_information<size>(rng).diagonal().asDiagonal();
  NormalEquations<size, reported> equations;
  equations.eliminate(normal, information);
  ASSERT_TRUE(equations.is_sound()) << seed;
  const Eigen::LDLT<Matrix> reference(normal + information);
  const Matrix covariance = reference.solve(Matrix::Identity());
  for (int i = 0; i < reported; ++i)
    for (int k = 0; k < reported; ++k)
      ASSERT_NEAR(equations.covariance()(i, k), covariance(i, k), 1e-8 * std::sqrt(covariance(i, i) * covariance(k, k)))
          << seed;
  for (int trial = 0; trial < 3; ++trial) {
    Eigen::Matrix<double, size, 1> right, solution;
    std::normal_distribution<double> value(0, 1);
    for (int i = 0; i < size; ++i) right[i] = value(rng) * std::sqrt(normal(i, i));
    equations.solve(right, solution);
    const Eigen::Matrix<double, size, 1> expected = reference.solve(right);
    for (int i = 0; i < size; ++i)
      ASSERT_NEAR(solution[i], expected[i], 1e-7 * std::sqrt(covariance(i, i)) * 10) << seed;
  }
}

TEST(NormalEquations, AgreesWithEigensDenseSolve) {
  for (unsigned seed = 0; seed < 100; ++seed) {
    compare_with_eigen<unknowns, reported_unknowns>(seed);
    compare_with_eigen<held_count, placed>(seed);
  }
}

TEST(NormalEquations, RefusesWhatIsNotPositiveDefinite) {
  std::mt19937 rng(4);
  NormalEquations<unknowns, reported_unknowns> equations;
  for (int i = 0; i < unknowns; ++i) {
    // One direction of negative curvature, along an unknown or across two of them.
    Normal normal = random_information<unknowns>(rng);
    Unknowns along = Unknowns::Unit(i) + 0.5 * Unknowns::Unit((i + 7) % unknowns);
    normal -= 1.01 * along * along.transpose() * (1 / along.dot(normal.ldlt().solve(along)));
    equations.eliminate(normal, Normal::Zero());
    EXPECT_FALSE(equations.is_sound()) << i;
    normal = random_information<unknowns>(rng);
    normal(i, i) = std::numeric_limits<double>::quiet_NaN();
    equations.eliminate(normal, Normal::Zero());
    EXPECT_FALSE(equations.is_sound()) << i;
  }
  equations.eliminate(random_information<unknowns>(rng), Normal::Zero());
  EXPECT_TRUE(equations.is_sound()) << "it can be used again";
}

}  // namespace
}  // namespace huetrack::outline
