#pragma once

#include <Eigen/Core>

namespace huetrack::solver {

// The rotation, translation and (with_scale) scale that take `from` to `to` with the least squared error, as a 4x4
// matrix: Umeyama 1991, by Eigen::umeyama(), which costs every file that instantiates it five seconds.
Eigen::Matrix4d umeyama(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to, bool with_scale);

}  // namespace huetrack::solver
