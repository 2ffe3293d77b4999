// A camera's pose from points with known positions, with its information matrix.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "calib/model/camera_model.h"
#include "calib/model/rigid3.h"
#include "camera_tracking/camera_estimate.h"

namespace huetrack::camera_tracking {

struct PoseObservation {
  Eigen::Vector3d p_world;
  Eigen::Vector2d px;   // raw
  double sigma_px = 1;  // of px
  // Where p_world is uncertain along its ray: one standard deviation of that, projected. Used by refine_swept_pose()
  // only.
  Eigen::Vector2d line_sigma_px = Eigen::Vector2d::Zero();
};

struct PoseFit {
  calib::Rigid3d cam_from_world;
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();  // of Tangent6d, at the given sigmas
  std::vector<double> error;   // per observation: norm of residual / sigma; infinity without a pixel
  std::vector<double> weight;  // 0..1, of the robust loss
  int inliers = 0;             // weight > inlier_weight
  double scale = 1;            // robust standard deviation of residual / sigma per axis: 1 where the sigmas are right
};

inline constexpr double rayleigh_median = 1.1774;  // maths: median norm of two normal residuals of sigma 1
inline constexpr double tukey = 4.685;             // maths: width of Tukey's loss with 95 % efficiency
inline constexpr double least_scale = 0.5;         // of PoseFit::scale in the loss: a few residuals may fit by chance
inline constexpr double inlier_weight = 0.1;

// Gauss-Newton with Tukey's loss, its width from the median residual. At least 3 observations.
//   start  within the basin of convergence
PoseFit refine_pose(const calib::CameraModel& lens, std::span<const PoseObservation> observations,
                    const calib::Rigid3d& start, int iterations = 10);

// Without a start: 4 or more points, coplanar or not (SQPnP; IPPE, of whose two poses the better one is returned).
// nullopt: no pose has the points in front of the camera.
std::optional<PoseFit> solve_pose(const calib::CameraModel& lens, std::span<const PoseObservation> observations);

// RANSAC (Fischler and Bolles 1981) over P3P, deterministic for a seed. nullopt: fewer than min_inliers observations
// within max_error_px * sigma_px.
std::optional<PoseFit> solve_pose_ransac(const calib::CameraModel& lens, std::span<const PoseObservation> observations,
                                         double max_error_px, int min_inliers, std::uint64_t seed);

// CameraEstimate::covariance from the covariance of the tangent xi of exp(xi) * cam_from_world, to first order.
Covariance6d world_covariance(const calib::Rigid3d& cam_from_world,
                              const Eigen::Matrix<double, 6, 6>& tangent_covariance);

// Covariance of the tangent: the inverse information, times scale^2 where the residuals exceed their sigmas.
Covariance6d tangent_covariance(const PoseFit& fit);
double position_sigma_m(const PoseFit& fit);  // of the camera's centre, all axes together

// d px / d xi for exp(xi) * cam_from_world, xi = (omega, v).
Eigen::Matrix<double, 2, 6> pose_jacobian(const calib::CameraModel::Jacobian& d_px_d_cam, const Eigen::Vector3d& p_cam);

}  // namespace huetrack::camera_tracking
