#include "camera_tracking/keyframes/local_bundle.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "camera_tracking/pose_solver.h"

namespace huetrack::keyframes {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix63d = Eigen::Matrix<double, 6, 3>;

struct Linear {  // one observation, whitened and weighted
  Eigen::Vector2d r;
  Eigen::Matrix<double, 2, 6> jp;
  Eigen::Matrix<double, 2, 3> jx;
  bool good = false;
};

constexpr double huber = 1.5;  // sigmas

// Sum of the robust costs; fills the residual lengths.
double cost_of(const calib::CameraModel& lens, const BundleProblem& p, std::vector<double>& length) {
  double cost = 0;
  for (std::size_t i = 0; i < p.observations.size(); ++i) {
    const BundleObservation& o = p.observations[i];
    const auto seen = lens.project(p.poses[static_cast<std::size_t>(o.pose)].cam_from_world *
                                   p.points[static_cast<std::size_t>(o.point)].position);
    length[i] = seen ? (seen->px - o.px).norm() / o.sigma_px : std::numeric_limits<double>::infinity();
    const double e = std::min(length[i], 1e3);
    cost += e < huber ? 0.5 * e * e : huber * (e - 0.5 * huber);
  }
  for (const BundlePoint& x : p.points) {
    if (x.prior_sigma_m > 0) cost += 0.5 * (x.position - x.prior).squaredNorm() / (x.prior_sigma_m * x.prior_sigma_m);
  }
  return cost;
}

}  // namespace

BundleResult adjust(const calib::CameraModel& lens, BundleProblem& p, int iterations) {
  BundleResult result;
  const std::size_t n = p.observations.size();
  std::vector<int> column(p.poses.size(), -1);
  int free_poses = 0;
  for (std::size_t i = 0; i < p.poses.size(); ++i) {
    if (!p.poses[i].fixed) column[i] = free_poses++;
  }
  std::vector<std::size_t> first(p.points.size() + 1, n);  // observations of each point
  for (std::size_t i = n; i-- > 0;) first[static_cast<std::size_t>(p.observations[i].point)] = i;
  for (std::size_t k = p.points.size(); k-- > 0;) first[k] = std::min(first[k], first[k + 1]);

  std::vector<Linear> linear(n);
  std::vector<double> length(n), trial_length(n);
  std::vector<Eigen::Matrix3d> v_inverse(p.points.size());
  std::vector<Eigen::Vector3d> bx(p.points.size());
  std::vector<Matrix63d> w(n);
  double cost = cost_of(lens, p, length);
  double lambda = 1e-4;
  const Eigen::Index size = 6 * free_poses;
  Eigen::MatrixXd s(size, size);
  Eigen::VectorXd b(size);
  for (int iteration = 0; iteration < iterations; ++iteration) {
    for (std::size_t i = 0; i < n; ++i) {
      const BundleObservation& o = p.observations[i];
      const calib::Rigid3d& pose = p.poses[static_cast<std::size_t>(o.pose)].cam_from_world;
      const Eigen::Vector3d cam = pose * p.points[static_cast<std::size_t>(o.point)].position;
      calib::CameraModel::Jacobian j;
      const auto seen = lens.project(cam, j);
      linear[i].good = seen.has_value();
      if (!seen) continue;
      const Eigen::Vector2d r = (seen->px - o.px) / o.sigma_px;
      const double e = r.norm(), weight = e < huber ? 1 : std::sqrt(huber / e);
      linear[i].r = weight * r;
      linear[i].jp = weight / o.sigma_px * camera_tracking::pose_jacobian(j, cam);
      linear[i].jx = weight / o.sigma_px * j * pose.rotation.toRotationMatrix();
    }
    bool improved = false;
    for (int attempt = 0; attempt < 4 && !improved; ++attempt) {
      s.setZero(), b.setZero();
      for (std::size_t k = 0; k < p.points.size(); ++k) {
        Eigen::Matrix3d v = Eigen::Matrix3d::Zero();
        bx[k].setZero();
        if (const double sigma = p.points[k].prior_sigma_m; sigma > 0) {
          v.diagonal().array() += 1 / (sigma * sigma);
          bx[k] += (p.points[k].position - p.points[k].prior) / (sigma * sigma);
        }
        for (std::size_t i = first[k]; i < first[k + 1]; ++i) {
          const Linear& l = linear[i];
          if (!l.good) continue;
          v += l.jx.transpose() * l.jx;
          bx[k] += l.jx.transpose() * l.r;
        }
        v.diagonal() *= 1 + lambda;
        v.diagonal().array() += 1e-6;
        v_inverse[k] = v.inverse();
        const Eigen::Vector3d vb = v_inverse[k] * bx[k];
        for (std::size_t i = first[k]; i < first[k + 1]; ++i) {
          const Linear& l = linear[i];
          const int ci = column[static_cast<std::size_t>(p.observations[i].pose)];
          if (!l.good || ci < 0) continue;
          w[i] = l.jp.transpose() * l.jx;
          const Matrix63d y = w[i] * v_inverse[k];
          auto diagonal = s.block<6, 6>(6 * ci, 6 * ci);
          diagonal += l.jp.transpose() * l.jp;
          b.segment<6>(6 * ci) += l.jp.transpose() * l.r - w[i] * vb;
          for (std::size_t m = first[k]; m <= i; ++m) {
            const int cm = column[static_cast<std::size_t>(p.observations[m].pose)];
            if (!linear[m].good || cm < 0) continue;
            const Matrix6d block = y * w[m].transpose();
            s.block<6, 6>(6 * ci, 6 * cm) -= block;
            if (m != i) s.block<6, 6>(6 * cm, 6 * ci) -= block.transpose();
          }
        }
      }
      for (int c = 0; c < free_poses; ++c) {
        for (int d = 0; d < 6; ++d) s(6 * c + d, 6 * c + d) *= 1 + lambda, s(6 * c + d, 6 * c + d) += 1e-9;
      }
      Eigen::VectorXd step = Eigen::VectorXd::Zero(size);
      if (free_poses > 0) step = -s.ldlt().solve(b);
      if (!step.allFinite()) return result;
      BundleProblem trial;
      trial.poses = p.poses, trial.points = p.points;
      trial.observations.swap(p.observations);  // not changed: lent
      for (std::size_t i = 0; i < p.poses.size(); ++i) {
        if (column[i] >= 0)
          trial.poses[i].cam_from_world =
              calib::exp(Vector6d(step.segment<6>(6 * column[i]))) * p.poses[i].cam_from_world;
      }
      for (std::size_t k = 0; k < p.points.size(); ++k) {
        Eigen::Vector3d rhs = bx[k];
        for (std::size_t i = first[k]; i < first[k + 1]; ++i) {
          const int c = column[static_cast<std::size_t>(trial.observations[i].pose)];
          if (linear[i].good && c >= 0) rhs += w[i].transpose() * step.segment<6>(6 * c);
        }
        trial.points[k].position -= v_inverse[k] * rhs;
      }
      const double trial_cost = cost_of(lens, trial, trial_length);
      p.observations.swap(trial.observations);
      if (trial_cost < cost) {
        improved = true;
        result.converged = cost - trial_cost < 1e-4 * cost;
        p.poses.swap(trial.poses), p.points.swap(trial.points), length.swap(trial_length);
        cost = trial_cost;
        lambda = std::max(1e-7, 0.2 * lambda);
      } else {
        lambda *= 10;
      }
    }
    if (!improved) result.converged = true;
    if (!improved || result.converged) break;
  }
  for (std::size_t k = 0; k < p.points.size(); ++k) p.points[k].covariance = v_inverse[k];
  std::vector<double> sorted = length;
  double scale = 1;
  if (!sorted.empty()) {
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    scale = std::max(0.7, *middle / 1.1774);
  }
  double sum = 0;
  int inliers = 0;
  for (std::size_t i = 0; i < n; ++i) {
    p.observations[i].outlier = !(length[i] < 3.5 * scale);
    if (!p.observations[i].outlier) sum += length[i] * length[i], ++inliers;
  }
  result.rms = std::sqrt(sum / std::max(1, 2 * inliers));
  return result;
}

}  // namespace huetrack::keyframes
