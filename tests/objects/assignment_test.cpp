#include "object_tracking/objects/assignment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <random>

namespace huetrack::objects {
namespace {

double cost_of(const Eigen::MatrixXd& costs, const std::vector<int>& columns, double none) {
  double sum = 0;
  for (std::size_t i = 0; i < columns.size(); ++i)
    sum += columns[i] < 0 ? none : costs(static_cast<Eigen::Index>(i), columns[i]);
  return sum;
}

// By enumeration.
double least_cost(const Eigen::MatrixXd& costs, double none) {
  double best = std::numeric_limits<double>::infinity();
  std::vector<int> columns(static_cast<std::size_t>(costs.rows()), -1);
  const std::function<void(std::size_t)> go_on = [&](std::size_t row) {
    if (row == columns.size()) {
      best = std::min(best, cost_of(costs, columns, none));
      return;
    }
    for (int c = -1; c < costs.cols(); ++c) {
      if (c >= 0 && std::find(columns.begin(), columns.begin() + static_cast<std::ptrdiff_t>(row), c) !=
                        columns.begin() + static_cast<std::ptrdiff_t>(row))
        continue;
      columns[row] = c;
      go_on(row + 1);
    }
    columns[row] = -1;
  };
  go_on(0);
  return best;
}

TEST(Assignment, HasTheLeastCostOfAllAssignments) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0, 80);
  for (int round = 0; round < 300; ++round) {
    const int rows = 1 + round % 5, columns = round / 5 % 6;
    Eigen::MatrixXd costs(rows, columns);
    for (Eigen::Index i = 0; i < costs.size(); ++i) {
      costs(i) = uniform(random);
      if (costs(i) > 60) costs(i) = std::numeric_limits<double>::infinity();  // outside the gate
    }
    const std::vector<int> found = assignment_of(costs, 50);
    ASSERT_EQ(found.size(), static_cast<std::size_t>(rows));
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (found[i] < 0) continue;
      EXPECT_LT(costs(static_cast<Eigen::Index>(i), found[i]), 50);
      EXPECT_EQ(std::ranges::count(found, found[i]), 1);
    }
    EXPECT_NEAR(cost_of(costs, found, 50), least_cost(costs, 50), 1e-9) << costs;
  }
}

}  // namespace
}  // namespace huetrack::objects
