#include "calib/wave/wave_adjustment.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/crs_matrix.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <glog/logging.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "calib/model/cross_matrix.h"
#include "calib/solver/calibration_error.h"
#include "calib/wave/outline_cost.h"

namespace huetrack::wave {
namespace {

using calib::cross_matrix;
using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

struct PriorCost {
  double mean, sigma;
  template <typename T>
  bool operator()(const T* x, T* residual) const {
    residual[0] = (x[0] - mean) / sigma;
    return true;
  }
};

// Residuals `first` to `first + N - 1` of a LensChange over `sigma`.
template <int N>
struct LensPriorCost {
  int first;
  LensChange sigma;
  template <typename T>
  bool operator()(const T* change, T* residuals) const {
    for (int i = 0; i < N; ++i) residuals[i] = change[first + i] / sigma[first + i];
    return true;
  }
};

// The third difference of the control points is the jerk times step^3.
struct SmoothCost {
  double weight;
  template <typename T>
  bool operator()(const T* a, const T* b, const T* c, const T* d, T* residuals) const {
    for (int i = 0; i < 3; ++i) residuals[i] = weight * (d[i] - 3.0 * c[i] + 3.0 * b[i] - a[i]);
    return true;
  }
};

struct DistanceCost {  // of two cameras; t and omega are about their bases
  Matrix3d base_a, base_b;
  double distance, weight;
  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    const Eigen::Matrix<T, 3, 1> ca = centre(base_a, a), cb = centre(base_b, b);
    residual[0] = weight * ((ca - cb).norm() / distance - 1.0);
    return true;
  }
  template <typename T>
  static Eigen::Matrix<T, 3, 1> centre(const Matrix3d& base, const T* block) {
    // R^T t = exp(-omega) base^T t
    const Eigen::Matrix<T, 3, 1> t(block[3], block[4], block[5]);
    const Eigen::Matrix<T, 3, 1> v = base.transpose().cast<T>() * t;
    const Eigen::Matrix<T, 3, 1> w(-block[0], -block[1], -block[2]);
    const T a2 = w.squaredNorm();
    if (a2 < 1e-16) return -(v + w.cross(v));
    const T a = ceres::sqrt(a2);
    return -(v + ceres::sin(a) / a * w.cross(v) + (1.0 - ceres::cos(a)) / a2 * w.cross(w.cross(v)));
  }
};

// Of all residuals, weighted by the loss; columns in the order of the blocks.
Eigen::SparseMatrix<double> jacobian_of(ceres::Problem& problem, const std::vector<double*>& blocks) {
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = blocks;
  options.num_threads = 1;
  ceres::CRSMatrix crs;
  problem.Evaluate(options, nullptr, nullptr, nullptr, &crs);
  std::vector<Eigen::Triplet<double>> entries;
  for (int row = 0; row < crs.num_rows; ++row) {
    for (int k = crs.rows[static_cast<std::size_t>(row)]; k < crs.rows[static_cast<std::size_t>(row) + 1]; ++k) {
      entries.emplace_back(row, crs.cols[static_cast<std::size_t>(k)], crs.values[static_cast<std::size_t>(k)]);
    }
  }
  Eigen::SparseMatrix<double> j(crs.num_rows, crs.num_cols);
  j.setFromTriplets(entries.begin(), entries.end());
  return j;
}

double log_determinant(const Eigen::SparseMatrix<double>& jacobian) {
  const Eigen::SparseMatrix<double> information = jacobian.transpose() * jacobian;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(information);
  if (solver.info() != Eigen::Success)
    throw solver::CalibrationError("the ball's path is not determined by what was seen");
  return solver.vectorD().array().max(1e-30).log().sum();
}

// Derivative of the estimated poses and times (columns, the `size` parameters of `wanted`) by the residuals (rows),
// with the path eliminated (Schur complement).
Eigen::MatrixXd gain_of(ceres::Problem& problem, const std::vector<double*>& wanted, Eigen::Index size,
                        const std::vector<double*>& points) {
  std::vector<double*> blocks = wanted;
  blocks.insert(blocks.end(), points.begin(), points.end());
  const Eigen::SparseMatrix<double> j = jacobian_of(problem, blocks);
  const Eigen::SparseMatrix<double> by_wanted = j.leftCols(size), by_point = j.rightCols(j.cols() - size);
  Eigen::SparseMatrix<double> pp = by_point.transpose() * by_point;
  const Eigen::SparseMatrix<double> pc = by_point.transpose() * by_wanted;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(pp);
  if (solver.info() != Eigen::Success)
    throw solver::CalibrationError("the ball's path is not determined by what was seen");
  const Eigen::MatrixXd cross = pc;
  const Eigen::MatrixXd path_by_wanted = solver.solve(cross);
  const Eigen::MatrixXd information =
      Eigen::MatrixXd(by_wanted.transpose() * by_wanted) - cross.transpose() * path_by_wanted;
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(information);
  const Eigen::MatrixXd covariance = ldlt.solve(Eigen::MatrixXd(Eigen::MatrixXd::Identity(size, size)));
  if (!covariance.allFinite() || (covariance.diagonal().array() <= 0).any()) {
    throw solver::CalibrationError("the camera poses are not determined by how the ball was moved",
                                   solver::Fault::undetermined_poses);
  }
  return (Eigen::MatrixXd(by_wanted) - by_point * path_by_wanted) * covariance;
}

// maths: square of the loss's scale in standard deviations, errors of a Cauchy distribution
constexpr double cauchy_scale2 = 2;
// Parameters of a lens that are right or wrong together: first and number.
constexpr std::array<std::pair<int, int>, 3> lens_groups{{{0, 1}, {1, 2}, {3, 4}}};

class QuietLog {  // Ceres logs every rejected step
 public:
  QuietLog() : level_(FLAGS_minloglevel) { FLAGS_minloglevel = google::GLOG_FATAL; }
  ~QuietLog() { FLAGS_minloglevel = level_; }
  QuietLog(const QuietLog&) = delete;
  QuietLog& operator=(const QuietLog&) = delete;

 private:
  int level_;
};

// Ceres orders parameter blocks by address, and the order decides the last digits: each kind lies in one array. Control
// points and times are optimised in place, in `state`.
class WaveProblem {
 public:
  WaveProblem(const calib::CameraRig& rig, const std::vector<BallObservation>& observations, WaveState& state,
              const WaveAdjustmentOptions& options)
      : rig_(rig), observations_(observations), state_(state), options_(options), poses_(rig.cameras.size()) {
    for (const calib::Rigid3d& pose : state.cam_from_world) base_.push_back(pose.rotation.toRotationMatrix());
    for (std::size_t c = 0; c < poses_.size(); ++c) {
      const Vector3d& t = state.cam_from_world[c].translation;
      poses_[c] = {0, 0, 0, t.x(), t.y(), t.z()};
    }
    add_observations();
    add_smoothness();
    if (!options.hold_poses) hold_scale();
    for (std::size_t c = 0; c < poses_.size(); ++c) {
      if (!is_free_pose(c) && problem_.HasParameterBlock(poses_[c].data()))
        problem_.SetParameterBlockConstant(poses_[c].data());
    }
    add_times();
    add_lenses();
  }

  // Returns the cost. throws CalibrationError
  double solve() {
    ceres::Solver::Options solver;
    solver.num_threads = 1;  // deterministic
    solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    solver.max_num_iterations = options_.max_iterations;
    solver.function_tolerance = 1e-8;
    solver.parameter_tolerance = 1e-9;
    solver.logging_type = ceres::SILENT;
    const QuietLog quiet;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem_, &summary);
    if (!summary.IsSolutionUsable())
      throw solver::CalibrationError("the adjustment does not converge: " + summary.message);
    for (std::size_t c = 0; c < poses_.size(); ++c) {
      if (!is_free_pose(c)) continue;
      const Vector3d omega(poses_[c].data());
      state_.cam_from_world[c] = {Eigen::Quaterniond(Matrix3d(base_[c] * rotation_of(omega))).normalized(),
                                  Vector3d(poses_[c].data() + 3)};
    }
    return summary.final_cost;
  }

  // Whether every observation is still near the piece of the path whose control points it depends on.
  bool is_on_its_pieces() const {
    constexpr double most_beyond = 0.25;  // steps; so far the polynomial of the neighbour hardly differs
    for (std::size_t i = 0; i < observations_.size(); ++i) {
      const double s =
          (exposed_s(observations_[i]) - state_.path.start_s) / state_.path.step_s - static_cast<double>(pieces_[i]);
      if (s < -most_beyond || s > 1 + most_beyond) return false;
    }
    return true;
  }

  // See WaveFit::evidence.
  double evidence(double cost) {
    std::vector<double*> blocks = free_blocks();
    for (Vector3d& p : state_.path.control) blocks.push_back(p.data());
    return -cost - log_determinant(jacobian_of(problem_, blocks)) / 2 -
           3 * static_cast<double>(state_.path.control.size() - 3) * std::log(third_difference());
  }

  // Sets both covariances of `fit`. variance: of the whitened residuals.
  void covariance(WaveFit& fit, double variance) {
    std::vector<double*> points;
    for (Vector3d& p : state_.path.control) points.push_back(p.data());
    const std::vector<double*> wanted = free_blocks();
    Eigen::Index size = 0;
    for (const double* block : wanted) size += problem_.ParameterBlockSize(block);
    const auto cameras = static_cast<Eigen::Index>(poses_.size());
    const Eigen::Index errors = (6 + lens_freedom) * cameras;
    fit.covariance = Eigen::MatrixXd::Zero(errors, errors);
    fit.time_covariance = Eigen::MatrixXd::Zero(2 * cameras, 2 * cameras);
    if (size == 0) return;
    Eigen::MatrixXd gain = gain_of(problem_, wanted, size, points);
    const auto prior_rows = static_cast<Eigen::Index>(prior_rows_.size());  // the last ones
    gain.bottomRows(prior_rows).array().colwise() *= Eigen::Map<const Eigen::ArrayXd>(prior_rows_.data(), prior_rows);
    const auto others = gain.rows() - 2 * static_cast<Eigen::Index>(observations_.size());
    const Eigen::MatrixXd in_blocks =
        variance * (propagated(gain, observations_, poses_.size(), options_.correlation) +
                    Eigen::MatrixXd(gain.bottomRows(others).transpose() * gain.bottomRows(others))) +
        by_wander(gain);
    // From (omega, t) to (centre, rotation): c = -R^T t.
    Eigen::MatrixXd pose_change = Eigen::MatrixXd::Zero(errors, size);
    Eigen::MatrixXd time_change = Eigen::MatrixXd::Zero(2 * cameras, size);
    Eigen::Index column = 0;
    for (std::size_t c = 0; c < poses_.size(); ++c) {
      if (!is_free_pose(c)) continue;
      const Matrix3d rotation = state_.cam_from_world[c].rotation.toRotationMatrix();
      const Vector3d centre = -rotation.transpose() * state_.cam_from_world[c].translation;
      const auto row = 6 * static_cast<Eigen::Index>(c);
      const Matrix3d jr = right_jacobian(Vector3d(poses_[c].data()));
      pose_change.block<3, 3>(row, column) = cross_matrix(centre) * jr;
      pose_change.block<3, 3>(row, column + 3) = -rotation.transpose();
      pose_change.block<3, 3>(row + 3, column) = jr;
      column += 6;
    }
    for (std::size_t c = 0; c < poses_.size(); ++c) {
      if (has_free_latency(c)) time_change(2 * static_cast<Eigen::Index>(c), column++) = 1;
      if (has_free_readout(c)) time_change(2 * static_cast<Eigen::Index>(c) + 1, column++) = 1;
    }
    for (std::size_t c = 0; c < poses_.size(); ++c) {
      if (!has_free_lens(c)) continue;
      pose_change.block<lens_freedom, lens_freedom>(6 * cameras + lens_freedom * static_cast<Eigen::Index>(c), column)
          .setIdentity();
      column += lens_freedom;
    }
    fit.covariance = pose_change * in_blocks * pose_change.transpose();
    fit.time_covariance = time_change * in_blocks * time_change.transpose();
  }

 private:
  double exposed_s(const BallObservation& o) const { return state_.exposed_s(rig_, o.camera, o.t_s, o.px); }

  // Covariance by WaveAdjustmentOptions::wander_s.
  Eigen::MatrixXd by_wander(const Eigen::MatrixXd& gain) const {
    constexpr double window_s = 1;
    std::map<std::pair<int, int>, Eigen::VectorXd> moved;  // by camera and second: derivative by its lag
    for (std::size_t i = 0; i < observations_.size() && !options_.wander_s.empty(); ++i) {
      const BallObservation& o = observations_[i];
      const auto c = static_cast<std::size_t>(o.camera);
      const double t_s = exposed_s(o);
      const calib::CameraModel lens = state_.lens(rig_, c);
      constexpr double soon_s = 1e-3;
      const auto px_at = [&](double t) {
        return outline_centre(lens, state_.cam_from_world[c] * state_.path.at(t), options_.radius_m);
      };
      const auto at = px_at(t_s), soon = px_at(t_s + soon_s);
      if (!at || !soon) continue;
      const Matrix2d information = o.covariance.inverse();
      const double distance2 = (*at - o.px).dot(information * (*at - o.px));
      const double weight = 1 / (1 + distance2 / (options_.loss * options_.loss));
      const Matrix2d whiten = information.llt().matrixL().transpose();
      const Vector2d whitened = std::sqrt(weight) * whiten * (*soon - *at) / soon_s;
      Eigen::VectorXd& sum =
          moved
              .try_emplace({o.camera, static_cast<int>(std::floor(t_s / window_s))}, Eigen::VectorXd::Zero(gain.cols()))
              .first->second;
      const auto row = 2 * static_cast<Eigen::Index>(i);
      sum += options_.wander_s[c] * (gain.middleRows<2>(row).transpose() * whitened);
    }
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(gain.cols(), gain.cols());
    for (const auto& [window, by] : moved) covariance += by * by.transpose();
    return covariance;
  }

  void add_observations() {
    used_.assign(poses_.size(), false);
    std::vector<Vector3d>& control = state_.path.control;
    // Shared, as it has no state; the problem owns it from the first residual on.
    ceres::LossFunction* loss = observations_.empty() ? nullptr : new ceres::CauchyLoss(options_.loss);
    for (const BallObservation& o : observations_) {
      const auto c = static_cast<std::size_t>(o.camera);
      const std::size_t first = state_.path.piece(exposed_s(o));
      pieces_.push_back(first);
      problem_.AddResidualBlock(outline_cost(rig_.cameras[c], base_[c], o, below_middle(rig_.cameras[c], o.px),
                                             state_.path, first, options_.radius_m)
                                    .release(),
                                loss, poses_[c].data(), control[first].data(), control[first + 1].data(),
                                control[first + 2].data(), control[first + 3].data(), &state_.times[c].latency_s,
                                &state_.times[c].readout_s, state_.lenses[c].data());
      used_[c] = true;
    }
  }

  void add_times() {
    const auto add_prior = [&](double* x, double mean, double sigma) {
      constexpr double loss = 3;  // sigmas; a contradicted prior loses weight
      problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<PriorCost, 1, 1>(new PriorCost{mean, sigma}),
                                new ceres::CauchyLoss(loss), x);
      prior_rows_.push_back(1);
    };
    for (std::size_t c = 0; c < poses_.size(); ++c) {
      if (!used_[c]) continue;
      CameraTime& time = state_.times[c];
      if (has_free_latency(c)) {
        add_prior(&time.latency_s, options_.times[c].time.latency_s, options_.times[c].latency_sigma_s);
      } else {
        problem_.SetParameterBlockConstant(&time.latency_s);
      }
      if (has_free_readout(c)) {
        if (!options_.any_readouts.empty()) {
          const ReadoutPrior& any = options_.any_readouts[c];
          problem_.AddResidualBlock(
              new ceres::AutoDiffCostFunction<PriorCost, 1, 1>(new PriorCost{any.mean_s, any.sigma_s}),
              new ceres::ScaledLoss(nullptr, any.weight, ceres::TAKE_OWNERSHIP), &time.readout_s);
          prior_rows_.push_back(std::sqrt(any.weight));
        }
        add_prior(&time.readout_s, options_.times[c].time.readout_s, options_.times[c].readout_sigma_s);
      } else {
        problem_.SetParameterBlockConstant(&time.readout_s);
      }
    }
  }
  // Focal length, principal point and distortion are right or wrong one without another.
  void add_lenses() {
    for (std::size_t c = 0; c < poses_.size(); ++c) {
      if (!used_[c]) continue;
      if (!has_free_lens(c)) {
        problem_.SetParameterBlockConstant(state_.lenses[c].data());
        continue;
      }
      add_lens_prior<lens_groups[0].first, lens_groups[0].second>(c);
      add_lens_prior<lens_groups[1].first, lens_groups[1].second>(c);
      add_lens_prior<lens_groups[2].first, lens_groups[2].second>(c);
    }
  }
  template <int first, int N>
  void add_lens_prior(std::size_t c) {
    const double weight = options_.frames_as_one[c];
    const auto add = [&](const LensChange& sigma, ceres::LossFunction* of) {
      problem_.AddResidualBlock(
          new ceres::AutoDiffCostFunction<LensPriorCost<N>, N, lens_freedom>(new LensPriorCost<N>{first, sigma}),
          new ceres::ScaledLoss(of, weight, ceres::TAKE_OWNERSHIP), state_.lenses[c].data());
      prior_rows_.insert(prior_rows_.end(), N, std::sqrt(weight));
    };
    add(options_.any_lens_sigmas[c], nullptr);
    if (!options_.given_lens_sigmas.empty())
      add(options_.given_lens_sigmas[c], new ceres::CauchyLoss(std::sqrt(cauchy_scale2)));
  }
  void add_smoothness() {
    std::vector<Vector3d>& control = state_.path.control;
    for (std::size_t k = 0; k + 3 < control.size(); ++k) {
      problem_.AddResidualBlock(
          new ceres::AutoDiffCostFunction<SmoothCost, 3, 3, 3, 3, 3>(new SmoothCost{1 / third_difference()}),
          new ceres::HuberLoss(3), control[k].data(), control[k + 1].data(), control[k + 2].data(),
          control[k + 3].data());
    }
  }

  void hold_scale() {
    const auto a = static_cast<std::size_t>(options_.scale_a), b = static_cast<std::size_t>(options_.scale_b);
    const double distance =
        (calib::inverse(state_.cam_from_world[a]).translation - calib::inverse(state_.cam_from_world[b]).translation)
            .norm();
    constexpr double per_metre = 1e5;  // as good as fixed, and still differentiable
    problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<DistanceCost, 1, 6, 6>(
                                  new DistanceCost{base_[a], base_[b], distance, per_metre}),
                              nullptr, poses_[a].data(), poses_[b].data());
  }

  // Standard deviation of a third difference of control points, for white jerk.
  double third_difference() const {
    const double h = state_.path.step_s;
    return options_.jerk_m_s3 * std::sqrt(1 / (30 * h)) * h * h * h;
  }

  // Estimated: free, and observed.
  bool is_free_pose(std::size_t c) const {
    return !options_.hold_poses && static_cast<int>(c) != options_.reference && used_[c];
  }
  bool has_free_readout(std::size_t c) const { return !options_.times.empty() && used_[c]; }
  bool has_free_latency(std::size_t c) const {
    return has_free_readout(c) && static_cast<int>(c) != options_.time_reference;
  }
  bool has_free_lens(std::size_t c) const { return !options_.any_lens_sigmas.empty() && used_[c]; }
  // Poses, then times, then lenses, by camera.
  std::vector<double*> free_blocks() {
    std::vector<double*> blocks;
    for (std::size_t c = 0; c < poses_.size(); ++c) {
      if (is_free_pose(c)) blocks.push_back(poses_[c].data());
    }
    for (std::size_t c = 0; c < poses_.size(); ++c) {
      if (has_free_latency(c)) blocks.push_back(&state_.times[c].latency_s);
      if (has_free_readout(c)) blocks.push_back(&state_.times[c].readout_s);
    }
    for (std::size_t c = 0; c < poses_.size(); ++c)
      if (has_free_lens(c)) blocks.push_back(state_.lenses[c].data());
    return blocks;
  }

  const calib::CameraRig& rig_;
  const std::vector<BallObservation>& observations_;
  WaveState& state_;
  const WaveAdjustmentOptions& options_;
  std::vector<std::array<double, 6>> poses_;  // rotation vector on top of base_, translation
  std::vector<Matrix3d> base_;
  std::vector<bool> used_;
  std::vector<std::size_t> pieces_;  // per observation: of the path
  std::vector<double> prior_rows_;   // per residual of the priors of times and lenses: its standard deviation
  ceres::Problem problem_;           // last: destroyed first
};

}  // namespace

Eigen::MatrixXd propagated(const Eigen::MatrixXd& gain, const std::vector<BallObservation>& observations,
                           std::size_t cameras, const OutlineCorrelation& correlation) {
  const Eigen::Index n = gain.cols();
  const auto rows = 2 * static_cast<Eigen::Index>(observations.size());
  Eigen::MatrixXd sum =
      (1 - correlation.constant_share - correlation.slow_share) * gain.topRows(rows).transpose() * gain.topRows(rows);
  for (std::size_t c = 0; c < cameras; ++c) {
    std::vector<std::size_t> own;
    for (std::size_t i = 0; i < observations.size(); ++i) {
      if (static_cast<std::size_t>(observations[i].camera) == c) own.push_back(i);
    }
    std::ranges::stable_sort(own, {}, [&](std::size_t i) { return observations[i].t_s; });
    for (const Eigen::Index axis : {0, 1}) {
      // Sum over all pairs of frames, weighted by exp(-dt / slow_s), recursively.
      Eigen::VectorXd all = Eigen::VectorXd::Zero(n), left = Eigen::VectorXd::Zero(n);
      Eigen::MatrixXd pairs = Eigen::MatrixXd::Zero(n, n);
      double before_s = 0;
      for (const std::size_t i : own) {
        const Eigen::VectorXd g = gain.row(2 * static_cast<Eigen::Index>(i) + axis);
        left *= std::exp((before_s - observations[i].t_s) / correlation.slow_s);
        before_s = observations[i].t_s;
        pairs += g * g.transpose() + g * left.transpose() + left * g.transpose();
        left += g;
        all += g;
      }
      sum += correlation.slow_share * pairs + correlation.constant_share * all * all.transpose();
    }
  }
  return sum;
}

double below_middle(const calib::Camera& camera, const Vector2d& px) {
  return camera.image_size.height > 1 ? px.y() / (camera.image_size.height - 1) - 0.5 : 0;
}

double WaveState::exposed_s(const calib::CameraRig& rig, int camera, double stamp_s, const Vector2d& px) const {
  const auto c = static_cast<std::size_t>(camera);
  if (times.empty()) return stamp_s;
  return stamp_s - times[c].latency_s + below_middle(rig.cameras[c], px) * times[c].readout_s;
}

double OutlineCorrelation::frames_as_one(double frame_s) const {
  const double next = std::exp(-frame_s / slow_s);  // correlation of two frames
  return (1 - constant_share - slow_share) + slow_share * (1 + next) / (1 - next);
}

calib::LensParameters changed(calib::LensParameters lens, const LensChange& change) {
  lens.head<2>() *= std::exp(change[0]);
  lens.segment<lens_freedom - 1>(2) += change.tail<lens_freedom - 1>();
  return lens;
}

calib::CameraModel changed(const calib::CameraModel& lens, const LensChange& change) {
  return calib::model_like(lens, changed(calib::parameters_of(lens), change));
}

Eigen::Matrix<double, 2, lens_freedom> by_change(const calib::PixelByLens& by_lens, const calib::LensParameters& lens) {
  Eigen::Matrix<double, 2, lens_freedom> out;
  out.col(0) = by_lens.leftCols<2>() * lens.head<2>();
  out.rightCols<lens_freedom - 1>() = by_lens.middleCols<lens_freedom - 1>(2);
  return out;
}

calib::CameraModel WaveState::lens(const calib::CameraRig& rig, std::size_t camera) const {
  return lenses.empty() ? rig.cameras[camera].model : changed(rig.cameras[camera].model, lenses[camera]);
}

double noise_variance(const std::vector<double>& distance2, double loss) {
  double sum = 0, weights = 0;
  for (const double d2 : distance2) {
    const double weight = 1 / (1 + d2 / (loss * loss));
    sum += weight * d2;
    weights += 2 * weight;
  }
  return std::max(1.0, sum / std::max(1.0, weights));
}

double lens_cost(const WaveAdjustmentOptions& options, const std::vector<LensChange>& lenses) {
  double sum = 0;
  for (std::size_t c = 0; c < std::min(lenses.size(), options.any_lens_sigmas.size()); ++c) {
    const double weight = options.frames_as_one[c];
    sum += weight / 2 * lenses[c].cwiseQuotient(options.any_lens_sigmas[c]).squaredNorm();
    if (options.given_lens_sigmas.empty()) continue;
    for (const auto& [first, count] : lens_groups) {
      double squares = 0;
      for (int i = first; i < first + count; ++i)
        squares += std::pow(lenses[c][i] / options.given_lens_sigmas[c][i], 2);
      sum += weight / 2 * cauchy_scale2 * std::log1p(squares / cauchy_scale2);
    }
  }
  return sum;
}

WaveFit adjust_wave(const calib::CameraRig& rig, const std::vector<BallObservation>& observations, WaveState& state,
                    const WaveAdjustmentOptions& options) {
  state.times.resize(rig.cameras.size());
  state.lenses.resize(rig.cameras.size(), LensChange::Zero());
  WaveFit fit;
  std::optional<WaveProblem> problem;
  constexpr int most_rounds = 8;  // as times change, observations move to other pieces of the path
  for (int round = 0; round < most_rounds; ++round) {
    problem.emplace(rig, observations, state, options);
    fit.cost = problem->solve();
    if (problem->is_on_its_pieces()) break;
  }
  std::vector<calib::CameraModel> lenses;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) lenses.push_back(state.lens(rig, c));
  for (const BallObservation& o : observations) {
    const auto c = static_cast<std::size_t>(o.camera);
    const Vector3d p = state.path.at(state.exposed_s(rig, o.camera, o.t_s, o.px));
    const auto px = outline_centre(lenses[c], state.cam_from_world[c] * p, options.radius_m);
    const Vector2d residual = px ? Vector2d(o.px - *px) : Vector2d::Constant(1e4);
    fit.residuals.push_back(residual);
    fit.distance2.push_back(residual.dot(o.covariance.inverse() * residual));
  }
  if (options.with_evidence) fit.evidence = problem->evidence(fit.cost);
  if (options.with_covariance) problem->covariance(fit, noise_variance(fit.distance2, options.loss));
  return fit;
}

}  // namespace huetrack::wave
