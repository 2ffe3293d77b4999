#include "camera_tracking/pose_solver.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>

#include "calib/model/cross_matrix.h"
#include "calib/model/median.h"
#include "particle_filter/random.h"

namespace huetrack::camera_tracking {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

calib::Rigid3d rigid_of(const cv::Mat& rvec, const cv::Mat& tvec) {
  const Eigen::Vector3d r(rvec.at<double>(0), rvec.at<double>(1), rvec.at<double>(2));
  const double angle = r.norm();
  return {angle > 0 ? Eigen::Quaterniond(Eigen::AngleAxisd(angle, r / angle)) : Eigen::Quaterniond::Identity(),
          {tvec.at<double>(0), tvec.at<double>(1), tvec.at<double>(2)}};
}

// Sum of squared residuals, in sigmas; infinity if a point is not in front of the camera.
double cost(const calib::CameraModel& lens, std::span<const PoseObservation> observations, const calib::Rigid3d& pose) {
  double sum = 0;
  for (const PoseObservation& o : observations) {
    const auto seen = lens.project(pose * o.p_world);
    if (!seen) return std::numeric_limits<double>::infinity();
    sum += (seen->px - o.px).squaredNorm() / (o.sigma_px * o.sigma_px);
  }
  return sum;
}

}  // namespace

Eigen::Matrix<double, 2, 6> pose_jacobian(const calib::CameraModel::Jacobian& d_px_d_cam, const Eigen::Vector3d& p) {
  Eigen::Matrix<double, 2, 6> j;
  j.leftCols<3>() = -d_px_d_cam * calib::cross_matrix(p);
  j.rightCols<3>() = d_px_d_cam;
  return j;
}

PoseFit refine_pose(const calib::CameraModel& lens, std::span<const PoseObservation> observations,
                    const calib::Rigid3d& start, int iterations) {
  PoseFit fit;
  fit.cam_from_world = start;
  const std::size_t n = observations.size();
  fit.error.assign(n, std::numeric_limits<double>::infinity());
  fit.weight.assign(n, 0);
  std::vector<Eigen::Vector2d> residual(n);
  std::vector<Eigen::Matrix<double, 2, 6>> jacobian(n);
  std::vector<double> known;
  for (int iteration = 0; iteration <= iterations; ++iteration) {
    known.clear();
    for (std::size_t i = 0; i < n; ++i) {
      const PoseObservation& o = observations[i];
      const Eigen::Vector3d p = fit.cam_from_world * o.p_world;
      calib::CameraModel::Jacobian j;
      const auto seen = lens.project(p, j);
      fit.error[i] = std::numeric_limits<double>::infinity();
      if (!seen) continue;
      residual[i] = (seen->px - o.px) / o.sigma_px;
      jacobian[i] = pose_jacobian(j, p) / o.sigma_px;
      fit.error[i] = residual[i].norm();
      known.push_back(fit.error[i]);
    }
    if (known.size() < 3) return fit;
    fit.scale = calib::median(known) / rayleigh_median;
    const double width = tukey * std::max(fit.scale, least_scale);
    Matrix6d h = Matrix6d::Zero();
    Vector6d b = Vector6d::Zero();
    fit.inliers = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const double x = fit.error[i] / width;
      const double w = x < 1 ? (1 - x * x) * (1 - x * x) : 0;
      fit.weight[i] = w;
      if (w <= 0) continue;
      fit.inliers += w > inlier_weight;
      h += w * jacobian[i].transpose() * jacobian[i];
      b += w * jacobian[i].transpose() * residual[i];
    }
    fit.information = h;
    if (iteration == iterations) break;
    Matrix6d damped = h;
    damped.diagonal() *= 1 + 1e-9;
    const Vector6d step = -damped.ldlt().solve(b);
    if (!step.allFinite() || step.head<3>().norm() > 1 || step.tail<3>().norm() > 10) return fit;
    fit.cam_from_world = calib::exp(step) * fit.cam_from_world;
    if (step.head<3>().norm() < 1e-7 && step.tail<3>().norm() < 1e-7 && iteration > 1) iteration = iterations - 1;
  }
  return fit;
}

std::optional<PoseFit> solve_pose(const calib::CameraModel& lens, std::span<const PoseObservation> observations) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> rays;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const PoseObservation& o : observations) {
    const auto ray = lens.ray({o.px});
    if (!ray || !(ray->z() > 0.05)) continue;
    points.emplace_back(o.p_world.x(), o.p_world.y(), o.p_world.z());
    rays.emplace_back(ray->x() / ray->z(), ray->y() / ray->z());
    centre += o.p_world;
  }
  if (points.size() < 4) return std::nullopt;
  centre /= static_cast<double>(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const PoseObservation& o : observations) spread += (o.p_world - centre) * (o.p_world - centre).transpose();
  const Eigen::Vector3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvalues();
  const bool plane = axes[0] < 1e-6 * axes[2];
  std::vector<cv::Mat> rvecs, tvecs;
  const cv::Matx33d identity = cv::Matx33d::eye();
  try {
    cv::solvePnPGeneric(points, rays, identity, cv::noArray(), rvecs, tvecs, false,
                        plane ? cv::SOLVEPNP_IPPE : cv::SOLVEPNP_SQPNP);
  } catch (const cv::Exception&) {  // points in one line, for instance
    return std::nullopt;
  }
  std::optional<PoseFit> best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < rvecs.size(); ++i) {
    const PoseFit fit = refine_pose(lens, observations, rigid_of(rvecs[i], tvecs[i]), 20);
    double robust = 0;  // truncated at 5 sigmas
    for (const double e : fit.error) robust += std::min(e * e, 25.0);
    const double c = observations.size() <= 6 ? cost(lens, observations, fit.cam_from_world) : robust;
    if (c < best_cost) best_cost = c, best = fit;
  }
  return best;
}

std::optional<PoseFit> solve_pose_ransac(const calib::CameraModel& lens, std::span<const PoseObservation> observations,
                                         double max_error_px, int min_inliers, std::uint64_t seed) {
  const std::size_t n = observations.size();
  if (n < 4 || static_cast<int>(n) < min_inliers) return std::nullopt;
  std::vector<Eigen::Vector3d> rays(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto ray = lens.ray({observations[i].px});
    rays[i] = ray && ray->z() > 0.05 ? Eigen::Vector3d(*ray / ray->z()) : Eigen::Vector3d(0, 0, 0);
  }
  particle_filter::Rng rng(seed);
  const auto inliers_of = [&](const calib::Rigid3d& pose, std::vector<PoseObservation>* out) {
    int count = 0;
    for (const PoseObservation& o : observations) {
      const auto seen = lens.project(pose * o.p_world);
      if (!seen || !((seen->px - o.px).norm() <= max_error_px * o.sigma_px)) continue;
      ++count;
      if (out) out->push_back(o);
    }
    return count;
  };
  int best_count = min_inliers - 1;
  std::optional<calib::Rigid3d> best;
  double needed = 300;
  for (int trial = 0; trial < 300 && trial < needed; ++trial) {
    std::size_t pick[4];
    for (std::size_t k = 0; k < 4; ++k) {
      do pick[k] = std::min(n - 1, static_cast<std::size_t>(rng.uniform() * static_cast<double>(n)));
      while (std::find(pick, pick + k, pick[k]) != pick + k);
    }
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> pixels;
    bool whole = true;
    for (const std::size_t i : pick) {
      whole = whole && rays[i].z() > 0;
      points.emplace_back(observations[i].p_world.x(), observations[i].p_world.y(), observations[i].p_world.z());
      pixels.emplace_back(rays[i].x(), rays[i].y());
    }
    if (!whole) continue;
    std::vector<cv::Mat> rvecs, tvecs;
    try {
      points.pop_back(), pixels.pop_back();
      cv::solveP3P(points, pixels, cv::Matx33d::eye(), cv::noArray(), rvecs, tvecs, cv::SOLVEPNP_AP3P);
    } catch (const cv::Exception&) {
      continue;  // three points in one line
    }
    for (std::size_t s = 0; s < rvecs.size(); ++s) {
      const calib::Rigid3d pose = rigid_of(rvecs[s], tvecs[s]);
      if (!pose.translation.allFinite() || !pose.rotation.coeffs().allFinite()) continue;
      const auto seen = lens.project(pose * observations[pick[3]].p_world);
      if (!seen || (seen->px - observations[pick[3]].px).norm() > 2 * max_error_px * observations[pick[3]].sigma_px)
        continue;
      const int count = inliers_of(pose, nullptr);
      if (count <= best_count) continue;
      best_count = count, best = pose;
      const double share = static_cast<double>(count) / static_cast<double>(n);
      needed = std::log(1e-3) / std::log(std::max(1e-12, 1 - std::pow(share, 4)));
    }
  }
  if (!best) return std::nullopt;
  std::vector<PoseObservation> inliers;
  inliers_of(*best, &inliers);
  PoseFit fit = refine_pose(lens, inliers, *best, 15);
  if (inliers_of(fit.cam_from_world, nullptr) < min_inliers) return std::nullopt;
  return fit;
}

Covariance6d tangent_covariance(const PoseFit& fit) {
  const double scale = std::max(1.0, fit.scale);
  const Covariance6d inverse = fit.information.inverse();
  return scale * scale * inverse;
}

double position_sigma_m(const PoseFit& fit) {
  return std::sqrt(world_covariance(fit.cam_from_world, tangent_covariance(fit)).topLeftCorner<3, 3>().trace());
}

Covariance6d world_covariance(const calib::Rigid3d& cam_from_world,
                              const Eigen::Matrix<double, 6, 6>& tangent_covariance) {
  // exp((omega, v)) cam_from_world: dt = -R^T v, w = -R^T omega, R of cam_from_world.
  const Eigen::Matrix3d back = -cam_from_world.rotation.toRotationMatrix().transpose();
  Matrix6d m = Matrix6d::Zero();
  m.topRightCorner<3, 3>() = back;
  m.bottomLeftCorner<3, 3>() = back;
  return m * tangent_covariance * m.transpose();
}

}  // namespace huetrack::camera_tracking
