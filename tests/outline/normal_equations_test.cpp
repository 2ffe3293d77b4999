#include "outline/normal_equations.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

namespace huetrack::outline {
namespace {

Normal some_information() {
  Normal slopes = Normal::Zero();
  for (int i = 0; i < unknowns; ++i)
    for (int k = 0; k < unknowns; ++k) slopes(i, k) = std::sin(1.7 * i + 0.9 * k + 0.3 * i * k);
  return slopes * slopes.transpose() + Normal::Identity();
}

TEST(NormalEquations, TellsWhatTheInverseSays) {
  const Normal normal = some_information(), information = 0.5 * Normal::Identity();
  NormalEquations<unknowns, told_unknowns> equations;
  equations.eliminate(normal, information);
  ASSERT_TRUE(equations.is_sound());
  const Normal inverse = (normal + information).inverse();
  EXPECT_TRUE(equations.covariance().isApprox(inverse.topLeftCorner<told_unknowns, told_unknowns>(), 1e-9));
  EXPECT_TRUE(equations.covariance_of_light().isApprox(inverse.block<lights, lights>(shading_, shading_), 1e-9));
  const Unknowns right = Unknowns::LinSpaced(-1, 2);
  Unknowns solution;
  equations.solve(right, solution);
  EXPECT_TRUE(solution.isApprox(inverse * right, 1e-9));
}

TEST(NormalEquations, OfFewUnknownsToo) {
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

TEST(NormalEquations, InvertsWhatIsKnownOfTheLight) {
  const LightMatrix matrix = some_information().topLeftCorner<lights, lights>();
  const auto inverse = inverse_of(matrix);
  ASSERT_TRUE(inverse);
  EXPECT_TRUE(inverse->isApprox(matrix.inverse(), 1e-9));
  EXPECT_FALSE(inverse_of(-matrix));
}

}  // namespace
}  // namespace huetrack::outline
