// SE(3): rigid transforms in three dimensions. A transform's name has both frames:
//   Rigid3d cam_from_world;  p_cam = cam_from_world * p_world
// and in a product the inner names must meet: cam1_from_cam0 = cam1_from_world * inverse(cam0_from_world).
// Metres, radians. Pure values; safe from any thread.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace huetrack::calib {

struct Rigid3d {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // unit
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();         // metres

  Eigen::Vector3d operator*(const Eigen::Vector3d& p) const { return rotation * p + translation; }
  Rigid3d operator*(const Rigid3d& other) const {
    return {(rotation * other.rotation).normalized(), rotation * other.translation + translation};
  }
};

Rigid3d inverse(const Rigid3d& a_from_b);

// The tangent is (omega, v): rotation vector in radians first, then metres.
using Tangent6d = Eigen::Matrix<double, 6, 1>;
Rigid3d exp(const Tangent6d& tangent);
Tangent6d log(const Rigid3d& transform);  // rotation angle in [0, pi]

}  // namespace huetrack::calib
