#include "object_tracking/objects/assignment.h"

#include <limits>

namespace huetrack::objects {

std::vector<int> assignment_of(const Eigen::MatrixXd& costs, double none) {
  const auto rows = int(costs.rows()), real = int(costs.cols());
  const int columns = real + rows;  // each row has a column of its own for `none`
  const double never = 1e3 * (none + 1);
  const auto cost = [&](int row, int column) {
    if (column < real) return costs(row, column) < none ? costs(row, column) : never;
    return column - real == row ? none : never;
  };
  constexpr double far = std::numeric_limits<double>::infinity();
  // Potentials, and the row of each column; counted from 1, 0 is none.
  std::vector<double> u(std::size_t(rows) + 1, 0), v(std::size_t(columns) + 1, 0);
  std::vector<int> row_of(std::size_t(columns) + 1, 0), previous(row_of.size(), 0);
  for (int row = 1; row <= rows; ++row) {
    row_of[0] = row;
    std::size_t at = 0;
    std::vector<double> least(row_of.size(), far);
    std::vector<char> is_used(row_of.size(), 0);
    do {
      is_used[at] = 1;
      const auto from = std::size_t(row_of[at]);
      double delta = far;
      std::size_t next = 0;
      for (std::size_t j = 1; j < row_of.size(); ++j) {
        if (is_used[j] != 0) continue;
        const double reduced = cost(int(from) - 1, int(j) - 1) - u[from] - v[j];
        if (reduced < least[j]) least[j] = reduced, previous[j] = int(at);
        if (least[j] < delta) delta = least[j], next = j;
      }
      for (std::size_t j = 0; j < row_of.size(); ++j) {
        if (is_used[j] != 0)
          u[std::size_t(row_of[j])] += delta, v[j] -= delta;
        else
          least[j] -= delta;
      }
      at = next;
    } while (row_of[at] != 0);
    while (at != 0) {
      const auto before = std::size_t(previous[at]);
      row_of[at] = row_of[before];
      at = before;
    }
  }
  std::vector<int> out(std::size_t(rows), -1);
  for (std::size_t j = 1; j <= std::size_t(real); ++j) {
    if (row_of[j] != 0) out[std::size_t(row_of[j]) - 1] = int(j) - 1;
  }
  return out;
}

}  // namespace huetrack::objects
