// Linear assignment.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace huetrack::objects {

// A column for each row, none twice, at the least sum of costs; -1: none, at the cost `none`, which also bounds the
// costs chosen. Hungarian method with shortest augmenting paths (Jonker and Volgenant 1987): O(rows^2 (rows +
// columns)).
std::vector<int> assignment_of(const Eigen::MatrixXd& costs, double none);

}  // namespace huetrack::objects
