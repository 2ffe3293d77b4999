// Where a position may be: the 95 % ellipse of a covariance in a plane, and how a covariance in space projects.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"

namespace huetrack::calib {

// What is squared and weighed by its covariance is below these in 95 % of the cases: the quantiles of chi-squared with
// 2 and 3 degrees of freedom.
inline constexpr double chi2_95_in_2d = 5.991, chi2_95_in_3d = 7.815;
inline constexpr double chi2_999_in_1d = 10.8, chi2_999_in_3d = 16.3;  // the same at 99.9 %, for gates
inline constexpr double chi_95_in_3d = 2.7955;  // the square root, with the digits that markers have always had

struct CovarianceEllipse {
  Eigen::Vector2d half_axes;   // the shorter one first, in the covariance's unit of length
  Eigen::Matrix2d directions;  // their unit vectors, as columns
  // On its border, counted from its middle; going once round for angle = 0..2 pi.
  Eigen::Vector2d at(double angle) const;
  std::vector<Eigen::Vector2d> ring(int points) const;
};

// covariance: finite; directions in which it is negative get no extent.
CovarianceEllipse ellipse_95(const Eigen::Matrix2d& covariance);

// The covariance of the pixel to which a position projects, to first order, px^2; nullopt where the position has no
// pixel, or the covariance is not finite.
std::optional<Eigen::Matrix2d> projected_covariance(const Camera& camera, const Eigen::Vector3d& p_world,
                                                    const Eigen::Matrix3d& covariance);

}  // namespace huetrack::calib
