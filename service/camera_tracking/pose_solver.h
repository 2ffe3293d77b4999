// A camera's pose from points with known positions, and how sure it is.
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
  // Where p_world is uncertain along a line: a standard deviation of that, as it is seen. refine_swept_pose() alone
  // heeds it.
  Eigen::Vector2d open_px = Eigen::Vector2d::Zero();
};

struct PoseFit {
  calib::Rigid3d cam_from_world;
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();  // of Tangent6d, at the given sigmas
  std::vector<double> error;   // per observation: residual / sigma (length of the two); infinity without a pixel
  std::vector<double> weight;  // 0..1, what the robust loss left of it
  int inliers = 0;             // weight > 0.1
  double scale = 1;            // robust standard deviation of residual / sigma per axis: 1 when the sigmas are true
};

// Gauss-Newton with Tukey's loss, its width from the median residual. start: near enough for it. At least 3
// observations.
PoseFit refine_pose(const calib::CameraModel& lens, std::span<const PoseObservation> observations,
                    const calib::Rigid3d& start, int iterations = 10);

// From nothing: 4 or more points, in a plane or not. Both poses of a plane are tried, the better one is given.
// nullopt: no pose has the points before the camera.
std::optional<PoseFit> solve_pose(const calib::CameraModel& lens, std::span<const PoseObservation> observations);

// Random sample consensus (Fischler and Bolles 1981) over P3P for matches of which many may be wrong. seed: same seed,
// same answer. nullopt: fewer than min_inliers within max_error_px.
std::optional<PoseFit> solve_pose_ransac(const calib::CameraModel& lens, std::span<const PoseObservation> observations,
                                         double max_error_px, int min_inliers, std::uint64_t seed);

// CameraEstimate::covariance from the information about Tangent6d of cam_from_world (exp(xi) * cam_from_world).
Covariance6d world_covariance(const calib::Rigid3d& cam_from_world,
                              const Eigen::Matrix<double, 6, 6>& tangent_covariance);

// d px / d xi for exp(xi) * cam_from_world, xi = (omega, v).
Eigen::Matrix<double, 2, 6> pose_jacobian(const calib::CameraModel::Jacobian& d_px_d_cam, const Eigen::Vector3d& p_cam);

}  // namespace huetrack::camera_tracking
