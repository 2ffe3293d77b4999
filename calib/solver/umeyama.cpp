#include "calib/solver/umeyama.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>

namespace huetrack::solver {

Eigen::Matrix4d umeyama(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to, bool with_scale) {
  return Eigen::umeyama(from, to, with_scale);
}

}  // namespace huetrack::solver
