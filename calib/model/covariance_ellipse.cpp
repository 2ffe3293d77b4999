#include "calib/model/covariance_ellipse.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <numbers>

namespace huetrack::calib {

std::vector<Eigen::Vector2d> CovarianceEllipse::ring(int points) const {
  std::vector<Eigen::Vector2d> border;
  border.reserve(static_cast<std::size_t>(std::max(0, points)));
  for (int i = 0; i < points; ++i) border.push_back(at(2 * std::numbers::pi * i / points));
  return border;
}

CovarianceEllipse ellipse_95(const Eigen::Matrix2d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(covariance);
  return {(axes.eigenvalues().cwiseMax(0) * chi2_95_in_2d).cwiseSqrt(), axes.eigenvectors()};
}

std::optional<Eigen::Matrix2d> projected_covariance(const Camera& camera, const Eigen::Vector3d& p_world,
                                                    const Eigen::Matrix3d& covariance) {
  CameraModel::Jacobian px_per_cam;
  if (!camera.model.project(camera.cam_from_world * p_world, px_per_cam) || !covariance.allFinite())
    return std::nullopt;
  const CameraModel::Jacobian px_per_world = px_per_cam * camera.cam_from_world.rotation.toRotationMatrix();
  Eigen::Matrix2d projected = (px_per_world * covariance * px_per_world.transpose()).triangularView<Eigen::Lower>();
  projected(0, 1) = projected(1, 0);  // one rounding for both: exactly symmetric
  return projected;
}

}  // namespace huetrack::calib
