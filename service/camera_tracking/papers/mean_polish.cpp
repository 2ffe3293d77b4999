#include "camera_tracking/papers/mean_polish.h"

#include <Eigen/LU>
#include <cmath>

namespace huetrack::papers {

std::optional<PoseFit> polish_mean(const calib::CameraModel& lens, const PoseParticles& cloud,
                                   const calib::Rigid3d& mean, std::span<const PoseObservation> seen) {
  constexpr int least = 4;
  constexpr double gate = 30;  // chi-square, 6 dof
  PoseFit fit = refine_pose(lens, seen, mean);
  if (fit.inliers < least || 2 * fit.inliers < static_cast<int>(seen.size())) return std::nullopt;
  const calib::Rigid3d back = calib::inverse(fit.cam_from_world), world_from_mean = calib::inverse(mean);
  const Eigen::AngleAxisd turn((back.rotation * world_from_mean.rotation.inverse()).normalized());
  Eigen::Matrix<double, 6, 1> error;
  error << back.translation - world_from_mean.translation, turn.angle() * turn.axis();
  const Covariance6d covariance = cloud.covariance(mean) + 1e-6 * Covariance6d::Identity();
  if (!(error.dot(covariance.inverse() * error) < gate)) return std::nullopt;
  return fit;
}

double sigma_px_of(const calib::CameraModel& lens, double pixel_sigma, double position_sigma_m, double depth_m) {
  return std::hypot(pixel_sigma, lens.fx() * position_sigma_m / depth_m);
}

}  // namespace huetrack::papers
