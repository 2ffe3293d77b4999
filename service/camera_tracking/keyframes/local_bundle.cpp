#include "camera_tracking/keyframes/local_bundle.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/model/median.h"
#include "camera_tracking/pose_solver.h"

namespace huetrack::keyframes {

namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix63d = Eigen::Matrix<double, 6, 3>;

constexpr double huber = 1.5;  // sigmas
// Levenberg-Marquardt: initial and least damping, and its factors after a good and a bad step.
constexpr double first_damping = 1e-4, least_damping = 1e-7, good_step = 0.2, bad_step = 10;
constexpr int attempts_per_iteration = 4;
constexpr double converged_share = 1e-4;                 // relative decrease of the cost that ends the iteration
constexpr double point_ridge = 1e-6, pose_ridge = 1e-9;  // against singular blocks
constexpr double least_outlier_scale = 0.7, outlier_scales = 3.5;  // of the residuals of outliers

struct Linear {  // one observation, whitened and weighted
  Eigen::Vector2d r;
  Eigen::Matrix<double, 2, 6> jp;
  Eigen::Matrix<double, 2, 3> jx;
  bool good = false;
};

class Adjustment {
 public:
  Adjustment(const calib::CameraModel& lens, BundleProblem& problem);
  BundleResult run(int iterations);

 private:
  double cost_of(const BundleProblem& p, std::vector<double>& length) const;
  void linearise();
  void eliminate_points(double damping);
  void eliminate(std::size_t point);
  double try_step(const Eigen::VectorXd& pose_step, BundleProblem& trial);
  double mark_outliers();  // returns the rms of the inliers
  int column_of(std::size_t observation) const {
    return column_[static_cast<std::size_t>(p_.observations[observation].pose)];
  }

  const calib::CameraModel& lens_;
  BundleProblem& p_;
  std::vector<int> column_;  // of each pose among the free ones; -1: fixed
  int free_poses_ = 0;
  std::vector<std::size_t> first_;               // observation of each point
  std::vector<calib::Rigid3d> row_from_middle_;  // per observation, of its pose
  std::vector<Linear> linear_;                   // per observation
  std::vector<double> length_, trial_length_;    // of the residuals, sigmas
  // The reduced normal equations s_ x = b_, and what is needed to back-substitute the points.
  std::vector<Eigen::Matrix3d> v_inverse_;  // per point
  std::vector<Eigen::Vector3d> bx_;         // per point
  std::vector<Matrix63d> w_;                // per observation
  Eigen::MatrixXd s_;
  Eigen::VectorXd b_;
};

Adjustment::Adjustment(const calib::CameraModel& lens, BundleProblem& problem)
    : lens_(lens), p_(problem), column_(problem.poses.size(), -1) {
  for (std::size_t i = 0; i < p_.poses.size(); ++i) {
    if (!p_.poses[i].fixed) column_[i] = free_poses_++;
  }
  const std::size_t n = p_.observations.size();
  first_.assign(p_.points.size() + 1, n);
  for (std::size_t i = n; i-- > 0;) first_[static_cast<std::size_t>(p_.observations[i].point)] = i;
  for (std::size_t k = p_.points.size(); k-- > 0;) first_[k] = std::min(first_[k], first_[k + 1]);
  row_from_middle_.reserve(n);
  for (const BundleObservation& o : p_.observations)
    row_from_middle_.push_back(p_.poses[static_cast<std::size_t>(o.pose)].sweep.row_from_middle(o.px.y()));
  linear_.resize(n), length_.resize(n), trial_length_.resize(n), w_.resize(n);
  v_inverse_.resize(p_.points.size()), bx_.resize(p_.points.size());
  const Eigen::Index size = 6 * free_poses_;
  s_.resize(size, size), b_.resize(size);
}

BundleResult Adjustment::run(int iterations) {
  BundleResult result;
  double cost = cost_of(p_, length_);
  double damping = first_damping;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    linearise();
    bool improved = false;
    for (int attempt = 0; attempt < attempts_per_iteration && !improved; ++attempt) {
      eliminate_points(damping);
      Eigen::VectorXd step = Eigen::VectorXd::Zero(b_.size());
      if (free_poses_ > 0) step = -s_.ldlt().solve(b_);
      if (!step.allFinite()) return result;
      BundleProblem trial;
      const double trial_cost = try_step(step, trial);
      improved = trial_cost < cost;
      if (!improved) {
        damping *= bad_step;
        continue;
      }
      result.converged = cost - trial_cost < converged_share * cost;
      p_.poses.swap(trial.poses), p_.points.swap(trial.points), length_.swap(trial_length_);
      cost = trial_cost;
      damping = std::max(least_damping, good_step * damping);
    }
    if (!improved) result.converged = true;
    if (result.converged) break;
  }
  for (std::size_t k = 0; k < p_.points.size(); ++k) p_.points[k].covariance = v_inverse_[k];
  result.rms = mark_outliers();
  return result;
}

// Sum of the robust costs; fills the residual lengths.
double Adjustment::cost_of(const BundleProblem& p, std::vector<double>& length) const {
  double cost = 0;
  for (std::size_t i = 0; i < p.observations.size(); ++i) {
    const BundleObservation& o = p.observations[i];
    const auto seen = lens_.project(row_from_middle_[i] * (p.poses[static_cast<std::size_t>(o.pose)].cam_from_world *
                                                           p.points[static_cast<std::size_t>(o.point)].position));
    length[i] = seen ? (seen->px - o.px).norm() / o.sigma_px : std::numeric_limits<double>::infinity();
    const double e = std::min(length[i], 1e3);
    cost += e < huber ? 0.5 * e * e : huber * (e - 0.5 * huber);
  }
  for (const BundlePoint& x : p.points) {
    if (x.prior_sigma_m > 0) cost += 0.5 * (x.position - x.prior).squaredNorm() / (x.prior_sigma_m * x.prior_sigma_m);
  }
  return cost;
}

void Adjustment::linearise() {
  for (std::size_t i = 0; i < p_.observations.size(); ++i) {
    const BundleObservation& o = p_.observations[i];
    const calib::Rigid3d& pose = p_.poses[static_cast<std::size_t>(o.pose)].cam_from_world;
    const Eigen::Vector3d cam = pose * p_.points[static_cast<std::size_t>(o.point)].position;
    calib::CameraModel::Jacobian j;
    const auto seen = lens_.project(row_from_middle_[i] * cam, j);
    linear_[i].good = seen.has_value();
    if (!seen) continue;
    j *= row_from_middle_[i].rotation.toRotationMatrix();
    const Eigen::Vector2d r = (seen->px - o.px) / o.sigma_px;
    const double e = r.norm(), weight = e < huber ? 1 : std::sqrt(huber / e);
    linear_[i].r = weight * r;
    linear_[i].jp = weight / o.sigma_px * pose_jacobian(j, cam);
    linear_[i].jx = weight / o.sigma_px * j * pose.rotation.toRotationMatrix();
  }
}

// Fills s_ and b_.
void Adjustment::eliminate_points(double damping) {
  s_.setZero(), b_.setZero();
  for (std::size_t k = 0; k < p_.points.size(); ++k) {
    Eigen::Matrix3d v = Eigen::Matrix3d::Zero();
    bx_[k].setZero();
    if (const double sigma = p_.points[k].prior_sigma_m; sigma > 0) {
      v.diagonal().array() += 1 / (sigma * sigma);
      bx_[k] += (p_.points[k].position - p_.points[k].prior) / (sigma * sigma);
    }
    for (std::size_t i = first_[k]; i < first_[k + 1]; ++i) {
      const Linear& l = linear_[i];
      if (!l.good) continue;
      v += l.jx.transpose() * l.jx;
      bx_[k] += l.jx.transpose() * l.r;
    }
    v.diagonal() *= 1 + damping;
    v.diagonal().array() += point_ridge;
    v_inverse_[k] = v.inverse();
    eliminate(k);
  }
  for (Eigen::Index d = 0; d < s_.rows(); ++d) s_(d, d) *= 1 + damping, s_(d, d) += pose_ridge;
}

// The contribution of one point's observations, less its Schur complement.
void Adjustment::eliminate(std::size_t k) {
  const Eigen::Vector3d vb = v_inverse_[k] * bx_[k];
  for (std::size_t i = first_[k]; i < first_[k + 1]; ++i) {
    const Linear& l = linear_[i];
    const int ci = column_of(i);
    if (!l.good || ci < 0) continue;
    w_[i] = l.jp.transpose() * l.jx;
    const Matrix63d y = w_[i] * v_inverse_[k];
    auto diagonal = s_.block<6, 6>(6 * ci, 6 * ci);
    diagonal += l.jp.transpose() * l.jp;
    b_.segment<6>(6 * ci) += l.jp.transpose() * l.r - w_[i] * vb;
    for (std::size_t m = first_[k]; m <= i; ++m) {
      const int cm = column_of(m);
      if (!linear_[m].good || cm < 0) continue;
      const Matrix6d block = y * w_[m].transpose();
      s_.block<6, 6>(6 * ci, 6 * cm) -= block;
      if (m != i) s_.block<6, 6>(6 * cm, 6 * ci) -= block.transpose();
    }
  }
}

// Applies the step to trial's poses and points; returns their cost.
double Adjustment::try_step(const Eigen::VectorXd& pose_step, BundleProblem& trial) {
  trial.poses = p_.poses, trial.points = p_.points;
  for (std::size_t i = 0; i < p_.poses.size(); ++i) {
    if (column_[i] >= 0)
      trial.poses[i].cam_from_world =
          calib::exp(Vector6d(pose_step.segment<6>(6 * column_[i]))) * p_.poses[i].cam_from_world;
  }
  for (std::size_t k = 0; k < p_.points.size(); ++k) {
    Eigen::Vector3d rhs = bx_[k];
    for (std::size_t i = first_[k]; i < first_[k + 1]; ++i) {
      const int c = column_of(i);
      if (linear_[i].good && c >= 0) rhs += w_[i].transpose() * pose_step.segment<6>(6 * c);
    }
    trial.points[k].position -= v_inverse_[k] * rhs;
  }
  trial.observations.swap(p_.observations);  // lent: they are constant
  const double cost = cost_of(trial, trial_length_);
  p_.observations.swap(trial.observations);
  return cost;
}

double Adjustment::mark_outliers() {
  const double scale = length_.empty() ? 1 : std::max(least_outlier_scale, calib::median(length_) / rayleigh_median);
  double sum = 0;
  int inliers = 0;
  for (std::size_t i = 0; i < p_.observations.size(); ++i) {
    p_.observations[i].outlier = !(length_[i] < outlier_scales * scale);
    if (!p_.observations[i].outlier) sum += length_[i] * length_[i], ++inliers;
  }
  return std::sqrt(sum / std::max(1, 2 * inliers));
}

}  // namespace

BundleResult adjust(const calib::CameraModel& lens, BundleProblem& problem, int iterations) {
  return Adjustment(lens, problem).run(iterations);
}

}  // namespace huetrack::keyframes
