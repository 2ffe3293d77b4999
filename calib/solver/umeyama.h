#pragma once

#include <Eigen/Core>

namespace huetrack::solver {

// Least-squares rotation, translation and (with_scale) scale from `from` to `to`, as a 4x4 matrix (Umeyama 1991). A
// wrapper of Eigen::umeyama(), which takes five seconds to compile.
Eigen::Matrix4d umeyama(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to, bool with_scale);

}  // namespace huetrack::solver
