#pragma once

#include <Eigen/Core>

namespace huetrack::calib {

// cross_matrix(v) * w = v x w
inline Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  return (Eigen::Matrix3d() << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0).finished();
}

}  // namespace huetrack::calib
