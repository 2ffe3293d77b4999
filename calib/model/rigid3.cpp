#include "calib/model/rigid3.h"

#include <cmath>

#include "calib/model/cross_matrix.h"

namespace huetrack::calib {
namespace {

// Below this angle (radians) the closed forms lose digits and the first terms of their series are exact to rounding.
constexpr double small_angle = 1e-3;

}  // namespace

Rigid3d inverse(const Rigid3d& a_from_b) {
  const Eigen::Quaterniond b_from_a = a_from_b.rotation.conjugate();
  return {b_from_a, -(b_from_a * a_from_b.translation)};
}

Rigid3d exp(const Tangent6d& tangent) {
  const Eigen::Vector3d omega = tangent.head<3>();
  const double angle = omega.norm(), angle2 = angle * angle;
  double half_sinc, b, c;  // sin(a/2)/a, (1 - cos a)/a^2, (a - sin a)/a^3
  if (angle < small_angle) {
    half_sinc = 0.5 - angle2 / 48 + angle2 * angle2 / 3840;
    b = 0.5 - angle2 / 24 + angle2 * angle2 / 720;
    c = 1.0 / 6 - angle2 / 120 + angle2 * angle2 / 5040;
  } else {
    half_sinc = std::sin(angle / 2) / angle;
    b = 2 * half_sinc * half_sinc;
    c = (angle - std::sin(angle)) / (angle2 * angle);
  }
  Eigen::Quaterniond rotation(std::cos(angle / 2), half_sinc * omega.x(), half_sinc * omega.y(), half_sinc * omega.z());
  const Eigen::Matrix3d w = cross_matrix(omega);
  return {rotation.normalized(), tangent.tail<3>() + b * (w * tangent.tail<3>()) + c * (w * (w * tangent.tail<3>()))};
}

Tangent6d log(const Rigid3d& transform) {
  // q and -q are the same rotation; the one with w >= 0 has the angle in [0, pi]. atan2 is exact at both ends.
  const double sign = transform.rotation.w() < 0 ? -1 : 1;
  const Eigen::Vector3d axis_sin = sign * transform.rotation.vec();
  const double sin_half = axis_sin.norm(), cos_half = sign * transform.rotation.w();
  const double angle = 2 * std::atan2(sin_half, cos_half), angle2 = angle * angle;
  const Eigen::Vector3d omega =
      axis_sin * (sin_half < small_angle ? (2 + angle2 / 12 + 7 * angle2 * angle2 / 2880) : angle / sin_half);
  // inverse of the left Jacobian: I - W/2 + d W^2, d = (1 - (a/2) cot(a/2)) / a^2
  const double d = angle < small_angle ? 1.0 / 12 + angle2 / 720 : (1 - angle / 2 * cos_half / sin_half) / angle2;
  const Eigen::Matrix3d w = cross_matrix(omega);
  const Eigen::Vector3d t = transform.translation;
  Tangent6d tangent;
  tangent << omega, t - 0.5 * (w * t) + d * (w * (w * t));
  return tangent;
}

}  // namespace huetrack::calib
