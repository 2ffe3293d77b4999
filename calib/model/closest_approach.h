// Where two rays come closest to each other. Every triangulation from two views uses it.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace huetrack::calib {

struct ClosestApproach {
  double along_0 = 0,
         along_1 = 0;  // metres along each ray to its point of closest approach; negative: behind the origin
  double sin2 = 0;     // squared sine of the angle between the rays
};

// Closest approach of the lines origin_0 + s direction_0 and origin_1 + t direction_1: the joining segment is
// perpendicular to both (Hartley and Zisserman, 2nd ed., section 12.2, midpoint method).
//   base        origin_1 - origin_0, metres
//   directions  unit vectors
//   min_sin2    nullopt if the squared sine of their angle is below it: nearly parallel rays have no stable crossing
// Exact up to a relative rounding error of some 1e-16 / sin2. Pure; thread-safe.
inline std::optional<ClosestApproach> closest_approach(const Eigen::Vector3d& base, const Eigen::Vector3d& direction_0,
                                                       const Eigen::Vector3d& direction_1, double min_sin2) {
  const double cosine = direction_0.dot(direction_1), sin2 = 1 - cosine * cosine;
  if (sin2 < min_sin2) return std::nullopt;
  return ClosestApproach{.along_0 = (base.dot(direction_0) - cosine * base.dot(direction_1)) / sin2,
                         .along_1 = (cosine * base.dot(direction_0) - base.dot(direction_1)) / sin2,
                         .sin2 = sin2};
}

}  // namespace huetrack::calib
