#include "calib/solver/corner_cost.h"

#include <gtest/gtest.h>

#include <array>
#include <ostream>

#include "calib/solver/adjustment_steps.h"
#include "solver/synthetic_rig.h"

namespace huetrack::solver {
namespace {

using Blocks = std::vector<std::vector<double>>;

std::vector<double*> pointers(Blocks& blocks) {
  std::vector<double*> out;
  for (auto& block : blocks) out.push_back(block.data());
  return out;
}

// Compares the analytic Jacobian of every block with central differences. A pose's columns are by its tangent (the
// first six of the block): differences go along the manifold `of`, by block; null: plain addition.
void expect_jacobians(const ceres::CostFunction& cost, Blocks blocks, const std::vector<const ceres::Manifold*>& of,
                      double tolerance = 1e-5) {
  const int rows = cost.num_residuals();
  const auto& sizes = cost.parameter_block_sizes();
  ASSERT_EQ(sizes.size(), blocks.size());
  Blocks jacobian;
  for (const int size : sizes) jacobian.emplace_back(static_cast<std::size_t>(rows * size));
  std::vector<double*> jacobians = pointers(jacobian);
  std::vector<double> residuals(static_cast<std::size_t>(rows));
  ASSERT_TRUE(cost.Evaluate(pointers(blocks).data(), residuals.data(), jacobians.data()));
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    ASSERT_EQ(static_cast<int>(blocks[b].size()), sizes[b]);
    const int tangent = of[b] ? of[b]->TangentSize() : sizes[b];
    for (int i = 0; i < tangent; ++i) {
      constexpr double h = 1e-6;
      const auto at = [&](double step) {
        Blocks moved = blocks;
        if (of[b]) {
          std::vector<double> delta(static_cast<std::size_t>(tangent), 0);
          delta[static_cast<std::size_t>(i)] = step;
          EXPECT_TRUE(of[b]->Plus(blocks[b].data(), delta.data(), moved[b].data()));
        } else {
          moved[b][static_cast<std::size_t>(i)] += step;
        }
        std::vector<double> out(static_cast<std::size_t>(rows));
        EXPECT_TRUE(cost.Evaluate(pointers(moved).data(), out.data(), nullptr));
        return out;
      };
      const auto more = at(h), less = at(-h);
      // As Ceres has it: the block's Jacobian times the manifold's.
      std::vector<double> plus(static_cast<std::size_t>(sizes[b] * tangent), 0);
      if (of[b]) {
        ASSERT_TRUE(of[b]->PlusJacobian(blocks[b].data(), plus.data()));
      }
      for (int r = 0; r < rows; ++r) {
        const double difference = (more[static_cast<std::size_t>(r)] - less[static_cast<std::size_t>(r)]) / (2 * h);
        double analytic = 0;
        if (of[b]) {
          for (int k = 0; k < sizes[b]; ++k)
            analytic += jacobian[b][static_cast<std::size_t>(r * sizes[b] + k)] *
                        plus[static_cast<std::size_t>(k * tangent + i)];
        } else {
          analytic = jacobian[b][static_cast<std::size_t>(r * sizes[b] + i)];
        }
        EXPECT_NEAR(analytic, difference, tolerance * (1 + std::abs(difference)))
            << "block " << b << ", residual " << r << ", direction " << i;
      }
    }
  }
}

struct TestedLens {
  LensModel lens;
  std::array<double, 12> parameters;
};
std::ostream& operator<<(std::ostream& out, const TestedLens& l) {
  return out << name(l.lens);
}

class CornerCostOf : public testing::TestWithParam<TestedLens> {};
INSTANTIATE_TEST_SUITE_P(
    AllLenses, CornerCostOf,
    testing::Values(TestedLens{LensModel::radtan4, {600, 610, 320, 240, -0.3, 0.1, 0.001, -0.002}},
                    TestedLens{LensModel::radtan5, {600, 610, 320, 240, -0.3, 0.1, 0.001, -0.002, 0.03}},
                    TestedLens{LensModel::radtan8,
                               {600, 610, 320, 240, 0.3, 0.1, 0.001, -0.002, 0.03, 0.4, 0.15, 0.02}},
                    TestedLens{LensModel::fisheye, {300, 310, 320, 240, 0.05, -0.01, 0.003, -0.001}},
                    TestedLens{LensModel::stereographic,
                               {300, 310, 320, 240, 0.1, -0.05, 0.001, -0.002, 0.02, -0.004, 0.003, -0.001}}),
    [](const auto& param_info) { return std::string(name(param_info.param.lens)); });

BoardCorner a_corner() {
  board::Board board;
  board.columns = 9, board.rows = 6, board.pitch = {0.06, 0.06};
  const BoardShape shape(board);
  return {shape.points[23], shape.by_warp[23], {310, 250}, -0.3};
}

std::vector<double> pose_block(const calib::Rigid3d& pose, const std::vector<double>& more = {}) {
  std::vector<double> block(pose_block_size);
  write_pose(pose, block.data());
  block.insert(block.end(), more.begin(), more.end());
  return block;
}

const calib::Rigid3d a_camera = looking_at({2, 0.4, 1.8}, {0, 0, 1});
const calib::Rigid3d a_board{Eigen::Quaterniond(0.5, -0.4, 0.6, 0.3).normalized(), {0.1, -0.2, 1.1}};

TEST_P(CornerCostOf, RestingBoardHasItsJacobians) {
  const auto& [lens, parameters] = GetParam();
  const auto left = pose_manifold(true), right = pose_manifold(false);
  expect_jacobians(
      *corner_cost(lens, a_corner()),
      {{parameters.begin(), parameters.end()}, pose_block(a_camera), pose_block(a_board), {0.002, -0.001, 0.003}},
      {nullptr, left.get(), right.get(), nullptr});
}

TEST_P(CornerCostOf, MovingBoardHasItsJacobians) {
  const auto& [lens, parameters] = GetParam();
  const auto left = pose_manifold(true), right = pose_manifold(false, 12 + 3);
  for (const double turned : {0.0, 0.8}) {  // with and without the series for small angles
    std::vector<double> more{turned, -turned, 0.5 * turned, 0.3,   -0.2, 0.5,   0.1, 0.3, -0.2,
                             0.4,    1,       -2,           0.001, 0,    -0.002};
    expect_jacobians(*moving_corner_cost(lens, a_corner(), 0.05, 2, 3),
                     {{parameters.begin(), parameters.end()},
                      pose_block(a_camera),
                      pose_block(a_board, more),
                      {0.002, -0.001, 0.003},
                      {0.004, 0.02}},
                     {nullptr, left.get(), right.get(), nullptr, nullptr}, 1e-4);
  }
}

TEST(CornerCost, BoardThatDoesNotMoveIsABoardAtRest) {
  const std::vector<double> lens{600, 610, 320, 240, -0.3, 0.1, 0, 0, 0, 0, 0, 0};
  Blocks rest{lens, pose_block(a_camera), pose_block(a_board), {0, 0, 0}};
  Blocks moving{lens, pose_block(a_camera), pose_block(a_board, std::vector<double>(13, 0)), {0, 0, 0}, {0.01, 0.02}};
  Eigen::Vector2d a, b;
  ASSERT_TRUE(corner_cost(LensModel::radtan4, a_corner())->Evaluate(pointers(rest).data(), a.data(), nullptr));
  ASSERT_TRUE(moving_corner_cost(LensModel::radtan4, a_corner(), 0.05, 0, 1)
                  ->Evaluate(pointers(moving).data(), b.data(), nullptr));
  EXPECT_LT((a - b).norm(), 1e-9);
}

TEST(CornerCost, CornerBehindTheCameraHasNoResidual) {
  calib::Rigid3d behind = a_camera;
  behind.translation.z() -= 20;
  Blocks blocks{{600, 610, 320, 240, 0, 0, 0, 0, 0, 0, 0, 0}, pose_block(behind), pose_block(a_board), {0, 0, 0}};
  Eigen::Vector2d residual;
  EXPECT_FALSE(
      corner_cost(LensModel::radtan4, a_corner())->Evaluate(pointers(blocks).data(), residual.data(), nullptr));
}

TEST(PoseManifold, MinusUndoesPlus) {
  for (const bool left : {true, false}) {
    const auto manifold = pose_manifold(left, 2);
    const std::vector<double> x = pose_block(a_board, {0.5, -1});
    const std::array<double, 8> delta{0.3, -0.2, 0.5, 0.1, -0.4, 0.2, 0.7, 1.5};
    std::vector<double> y(x.size());
    std::array<double, 8> back{};
    ASSERT_TRUE(manifold->Plus(x.data(), delta.data(), y.data()));
    ASSERT_TRUE(manifold->Minus(y.data(), x.data(), back.data()));
    for (std::size_t i = 0; i < 8; ++i) EXPECT_NEAR(back[i], delta[i], 1e-12) << left << i;
  }
}

TEST(PriorCosts, HaveTheirJacobians) {
  BoardMotion motion;
  motion.expected = BoardMotion::Course::Constant(0.1);
  for (std::size_t i = 0; i < 6; ++i)
    motion.information[i] = (Eigen::Matrix2d() << 3.0 + double(i), 0.5, 0.5, 2).finished();
  const auto manifold = pose_manifold(false, 13);
  std::vector<double> more(13);
  for (std::size_t i = 0; i < more.size(); ++i) more[i] = 0.05 * double(i) - 0.2;
  const int block_size = pose_block_size + 13;
  expect_jacobians(*course_cost(block_size, motion, 0.1), {pose_block(a_board, more)}, {manifold.get()});
  expect_jacobians(*prior_cost(block_size, stamps_at, {0.01}, {30}), {pose_block(a_board, more)}, {manifold.get()});

  LensPrior prior;
  prior.mean << 600, 600, 320, 240, -0.2, 0, 0, 0, 0, 0, 0, 0;
  Eigen::MatrixXd root = Eigen::MatrixXd::Identity(8, 8);
  root(4, 5) = 0.5, root(0, 1) = -0.9;
  prior.information = root.transpose() * root;
  expect_jacobians(*lens_prior_cost(prior, 0.2), {{610, 590, 325, 238, -0.1, 0.1, 0.01, -0.02, 0, 0, 0, 0}}, {nullptr});
}

// noise_px per standard deviation: a mean that is off by k sigma costs (k noise_px)^2.
TEST(PriorCosts, CostOneNoisePerStandardDeviation) {
  LensPrior prior;
  prior.information = Eigen::MatrixXd::Identity(8, 8) / (0.5 * 0.5);
  Blocks block{{1.5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}};
  Eigen::VectorXd residual(8);
  ASSERT_TRUE(lens_prior_cost(prior, 0.2)->Evaluate(pointers(block).data(), residual.data(), nullptr));
  EXPECT_NEAR(residual.norm(), 3 * 0.2, 1e-12);
}

TEST_P(CornerCostOf, ShapeCostIsZeroForAHealthyLensAndHasItsJacobiansForAFoldedOne) {
  const auto& [lens, parameters] = GetParam();
  const std::vector<double> healthy(parameters.begin(), parameters.end());
  const auto cost = lens_shape_cost(lens, 0.6, 50);
  std::array<double, 16> residuals{};
  Blocks blocks{healthy};
  ASSERT_TRUE(cost->Evaluate(pointers(blocks).data(), residuals.data(), nullptr));
  for (const double r : residuals) EXPECT_EQ(r, 0);
  std::vector<double> folded = healthy;
  folded[4] = -2;  // the radius shrinks towards the image's corners
  if (lens == LensModel::radtan8) folded[9] = -1.5;
  blocks = {folded};
  ASSERT_TRUE(cost->Evaluate(pointers(blocks).data(), residuals.data(), nullptr));
  EXPECT_GT(*std::ranges::max_element(residuals), 1);
  expect_jacobians(*cost, {folded}, {nullptr}, 1e-4);
}

}  // namespace
}  // namespace huetrack::solver
