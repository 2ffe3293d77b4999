// The assignment of least cost.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace huetrack::objects {

// One column for each row of the costs, no column twice, so that the sum is least; -1: none, at the cost of `none`.
// Costs above `none` are never chosen. The Hungarian method with shortest augmenting paths (Jonker and Volgenant 1987):
// rows^2 (rows + columns).
std::vector<int> assignment_of(const Eigen::MatrixXd& costs, double none);

}  // namespace huetrack::objects
