// The 95 % ellipse of a 2-D covariance, and the projection of a 3-D covariance into an image.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"

namespace huetrack::calib {

// 95 % quantiles of the chi-square distribution with 2 and 3 degrees of freedom.
inline constexpr double chi2_95_in_2d = 5.991, chi2_95_in_3d = 7.815;
inline constexpr double chi2_999_in_1d = 10.8, chi2_999_in_3d = 16.3;  // the same at 99.9 %, for gates
inline constexpr double chi_95_in_3d = 2.7955;                         // square root of the second, rounded

struct CovarianceEllipse {
  Eigen::Vector2d half_axes;   // the shorter one first, 1 unit of length
  Eigen::Matrix2d directions;  // unit vectors of the axes, as columns
  // Point of the border, relative to the centre; angle = 0..2 pi.
  Eigen::Vector2d at(double angle) const {
    return directions * half_axes.cwiseProduct(Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  std::vector<Eigen::Vector2d> ring(int points) const;
};

// covariance: finite; a negative eigenvalue gives extent 0.
CovarianceEllipse ellipse_95(const Eigen::Matrix2d& covariance);

// First-order covariance of a position's pixel, px^2; nullopt: the position has no pixel, or the covariance is not
// finite.
std::optional<Eigen::Matrix2d> projected_covariance(const Camera& camera, const Eigen::Vector3d& p_world,
                                                    const Eigen::Matrix3d& covariance);

}  // namespace huetrack::calib
