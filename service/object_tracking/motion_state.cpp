#include "object_tracking/motion_state.h"

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>

#include "object_tracking/sighting.h"
#include "particle_filter/vector_clones.h"

namespace huetrack::object_tracking {
namespace {

struct MotionTuning {
  double synced_latency_sigma_s = 0.0002;      // s, cameras with one trigger: exposures are set alike
  double synced_readout_sigma_s = 0.0005;      // s, the same: mostly global shutters
  double latency_walk_s2_per_s = 1e-4 * 1e-4;  // s^2/s, exposure time follows the light: 1 ms in one or two minutes
  double bias_length_m = 0.5;    // m, correlation length of the image bias: half a metre on, the light is another
  double size_sigma = 0.02;      // of the log of the object's radius over the configured one: a millimetre of 50
  double size_loss = 1.345;      // sigmas, Huber's loss of a measured radius: 95 % efficiency (Huber 1981)
  double relinearize_s = 0.005;  // s, error of a time from which velocity times time must be linearised again
};
constexpr MotionTuning motion_tuning{};

constexpr Eigen::Index most_states_near = 128;  // layout: 128 kB of covariance
constexpr std::ptrdiff_t most_open = 8;         // layout: columns of four observations
constexpr Eigen::Index times_at = 7;            // layout: the readout of the reference camera
constexpr double least_time_variance_s2 =
    1e-16;  // maths: of times that are given exactly, so that they have an inverse

// A time that the rig states without a sigma has `same_time_s` as 1 sigma.
double variance_of(const std::optional<double>& value, const std::optional<double>& sigma) {
  const double s = sigma.value_or(value ? sighting_tuning.same_time_s : time_prior.unknown_sigma_s);
  return s * s;
}

}  // namespace

double largest_variance(const Eigen::Matrix3d& covariance) {
  // Closed form: fast, and exact enough for a bound.
  const auto axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>().computeDirect(covariance, Eigen::EigenvaluesOnly);
  return std::max(0.0, axes.eigenvalues()(2));
}

double largest_sigma(const Eigen::Matrix3d& covariance) {
  return std::sqrt(largest_variance(covariance));
}

MotionState::MotionState(const calib::CameraRig& rig, bool times_are_learnt) : times_are_learnt_(times_are_learnt) {
  if (rig.cameras.size() > max_cameras)
    throw std::invalid_argument(
        fmt::format("a tracker takes at most {} cameras, this rig has {}", max_cameras, rig.cameras.size()));
  const auto cameras = static_cast<Eigen::Index>(rig.cameras.size());
  const Eigen::Index n = 6 + (times_are_learnt ? 4 : 2) * cameras + (cameras == 1 ? 2 : 0);
  mean_ = Eigen::VectorXd::Zero(n);
  covariance_ = Eigen::MatrixXd::Zero(n, n);
  if (n > most_states_near) gains_ = seen_ = Eigen::MatrixXd::Zero(n, most_open);
  if (times_are_learnt) times_linearised_ = Eigen::VectorXd::Zero(2 * cameras);
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const calib::CameraTiming& timing = rig.cameras[c].timing;
    Given given{.latency_s = timing.latency_s.value_or(0), .readout_s = timing.readout_s.value_or(0)};
    if (times_are_learnt) {
      const Eigen::Index latency = latency_of(int(c));
      if (int(c) != reference_camera)
        covariance_(latency, latency) = variance_of(timing.latency_s, timing.latency_sigma_s);
      given.readout_prior_s2 = variance_of(timing.readout_s, timing.readout_sigma_s);
      covariance_(latency + 1, latency + 1) = given.readout_prior_s2;
    } else {
      given.latency_variance_s2 = std::pow(timing.latency_sigma_s.value_or(0), 2);
      given.readout_variance_s2 = std::pow(timing.readout_sigma_s.value_or(0), 2);
    }
    given_.push_back(given);
  }
  biases_.resize(given_.size());
  if (has_size()) covariance_(size_at(), size_at()) = motion_tuning.size_sigma * motion_tuning.size_sigma;
  clocks_.resize(given_.size());
  if (times_are_learnt) set_times_shared();
}

double MotionState::relative_clock_variance_s2(int camera) const {
  const Clock &clock = clocks_[std::size_t(camera)], &reference = clocks_[reference_camera];
  return clock.of == reference.of ? 0 : clock.variance_s2 + reference.variance_s2;
}

void MotionState::open_clocks(const capture::FrameSet& set) {
  bool is_ours = true;
  for (std::size_t c = 0; c < clocks_.size() && c < set.frames.size(); ++c) {
    if (set.frames[c]) {
      const capture::StampClock& clock = set.frames[c]->clock;
      clocks_[c] = {.of = clock.of, .variance_s2 = std::pow(capture::seconds(clock.sigma), 2)};
    }
    is_ours = is_ours && clocks_[c].of == clocks_[reference_camera].of;
  }
  if (is_ours || !times_are_learnt_) return;
  by_nuisances_.reset();
  Times shared = *shared_times_;
  const int cameras = int(clocks_.size());
  for (int first = 0; first < cameras; ++first) {
    const auto is_of = [&](int c) { return clocks_[std::size_t(c)].of == clocks_[std::size_t(first)].of; };
    bool is_counted = is_of(reference_camera);
    for (int c = 0; c < first; ++c) is_counted = is_counted || is_of(c);
    if (is_counted) continue;
    double least = std::numeric_limits<double>::infinity(), wanted = 0;
    for (int c = first; c < cameras; ++c) {
      if (!is_of(c)) continue;
      least = std::min(least, covariance_(latency_of(c), latency_of(c)));
      wanted = std::max(wanted, relative_clock_variance_s2(c));
    }
    if (wanted <= least) continue;
    for (int a = first; a < cameras; ++a) {
      for (int b = first; b < cameras; ++b) {
        if (!is_of(a) || !is_of(b)) continue;
        if (b <= a) covariance_(latency_of(a), latency_of(b)) += wanted - least;
        shared.covariance(latency_of(a) - times_at, latency_of(b) - times_at) += wanted - least;
      }
    }
  }
  shared_times_ = std::make_shared<const Times>(std::move(shared));
}

void MotionState::expect_synchronised() {
  by_nuisances_.reset();
  if (!times_are_learnt_ || are_times_corrected_) return;
  is_synchronised_ = true;
  for (int c = 0; c < int(given_.size()); ++c) {
    const Eigen::Index l = latency_of(c), r = l + 1;
    const auto at_most = [&](Eigen::Index i, double sigma) {
      covariance_(i, i) = std::min(covariance_(i, i), sigma * sigma);
    };
    at_most(l, motion_tuning.synced_latency_sigma_s);
    at_most(r, motion_tuning.synced_readout_sigma_s);
  }
}

void MotionState::correct_times(std::span<const double> late_s) {
  if (!times_are_learnt_) return;
  by_nuisances_.reset();
  settle();
  const auto open = [&](Eigen::Index i, double variance_s2) {
    covariance_.row(i).setZero();
    covariance_.col(i).setZero();
    covariance_(i, i) = variance_s2;
  };
  double furthest_s = 0;
  for (int c = 0; c < int(given_.size()); ++c) {
    const auto camera = std::size_t(c);
    furthest_s = std::max(furthest_s, std::abs(late_s[camera]));
    const Eigen::Index latency = latency_of(c);
    mean_(latency) += late_s[camera];
    const bool is_other = late_s[camera] != late_s[reference_camera];
    if (c != reference_camera && (is_synchronised_ || is_other)) open(latency, std::pow(time_prior.unknown_sigma_s, 2));
    if (is_synchronised_) open(latency + 1, given_[camera].readout_prior_s2);
  }
  is_synchronised_ = false;
  are_times_corrected_ = true;
  covariance_.diagonal().head<3>().array() += std::pow(furthest_s * velocity().norm(), 2);
  set_times_shared();
}

bool MotionState::needs_relinearisation() const {
  if (!times_are_learnt_) return false;
  return (mean_.segment(6, times_linearised_.size()) - times_linearised_).cwiseAbs().maxCoeff() >
         motion_tuning.relinearize_s;
}

void MotionState::relinearise_times_at(const MotionState& known) {
  times_linearised_ = known.mean_.segment(6, times_linearised_.size());
}

double MotionState::row_offset_s(int camera, double below_middle) const {
  if (!times_are_learnt_) return 0;
  const Eigen::Index latency = latency_of(camera);
  return below_middle * mean_(latency + 1) - mean_(latency);
}

double MotionState::row_sigma_s(int camera, double below_middle) const {
  const Given& given = given_[std::size_t(camera)];
  double variance = given.latency_variance_s2 + below_middle * below_middle * given.readout_variance_s2;
  if (!times_are_learnt_) variance += relative_clock_variance_s2(camera);
  if (times_are_learnt_) {
    const Eigen::Index l = latency_of(camera), r = l + 1;
    variance +=
        covariance_(l, l) - 2 * below_middle * below_diagonal(r, l) + below_middle * below_middle * covariance_(r, r);
  }
  return std::sqrt(std::max(0.0, variance));
}

CameraTimingEstimate MotionState::timing(int camera) const {
  const Given& given = given_[std::size_t(camera)];
  if (!times_are_learnt_)
    return {given.latency_s, std::sqrt(given.latency_variance_s2), given.readout_s,
            std::sqrt(given.readout_variance_s2)};
  const Eigen::Index l = latency_of(camera), r = l + 1;
  return {given.latency_s + mean_(l), std::sqrt(covariance_(l, l)), given.readout_s + mean_(r),
          std::sqrt(covariance_(r, r))};
}

MotionState::Times MotionState::times() const {
  MotionState settled = *this;
  settled.settle();
  const Eigen::MatrixXd lower = settled.covariance_.block(times_at, times_at, times_size(), times_size());
  Times out{mean_.segment(times_at, times_size()), lower.selfadjointView<Eigen::Lower>()};
  out.covariance.diagonal().array() += least_time_variance_s2;
  return out;
}

MotionState::Times MotionState::shared_times() const {
  Times out = *shared_times_;
  for (Eigen::Index i = 1; i < times_size(); i += 2)
    out.covariance(i, i) += motion_tuning.latency_walk_s2_per_s * since_shared_s_;
  return out;
}

void MotionState::set_times_shared() {
  if (!times_are_learnt_) return;
  shared_times_ = std::make_shared<const Times>(times());
  since_shared_s_ = 0;
}

TimesInformation MotionState::unshared_times() const {
  const Eigen::Index n = times_are_learnt_ ? times_size() : 0;
  TimesInformation out{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)};
  if (n == 0) return out;
  const Times now = times(), shared = shared_times();
  out.matrix = now.covariance.inverse();
  out.vector = out.matrix * now.mean;
  const Eigen::MatrixXd before = shared.covariance.inverse();
  out.matrix -= before;
  out.vector -= before * shared.mean;
  return out;
}

void MotionState::add_times(const TimesInformation& shown) {
  if (!times_are_learnt_) return;
  const auto with_shown = [&](const Times& known) -> std::optional<Times> {
    const Eigen::MatrixXd before = known.covariance.inverse();
    const Eigen::LLT<Eigen::MatrixXd> information(before + shown.matrix);
    if (information.info() != Eigen::Success) return std::nullopt;
    Times out;
    out.mean = information.solve(before * known.mean + shown.vector);
    out.covariance = information.solve(Eigen::MatrixXd::Identity(times_size(), times_size()));
    return out;
  };
  const auto now = with_shown(times()), shared = with_shown(shared_times());
  if (!now || !shared) return;
  set_times(*now);
  shared_times_ = std::make_shared<const Times>(*shared);
  since_shared_s_ = 0;
}

void MotionState::set_times(const Times& times) {
  by_nuisances_.reset();
  settle();
  const Times before = this->times();
  const Eigen::MatrixXd all = covariance_.selfadjointView<Eigen::Lower>();
  Eigen::MatrixXd regression = all.middleCols(times_at, times_size()) * before.covariance.inverse();
  regression.middleRows(times_at, times_size()).setIdentity();
  mean_ += regression * (times.mean - before.mean);
  covariance_ = all + regression * (times.covariance - before.covariance) * regression.transpose();
  keep_times_open(before.covariance.diagonal());
}

void MotionState::forget_unshared_times() {
  if (times_are_learnt_) set_times(shared_times());
}

void MotionState::adopt_time_assumptions(const MotionState& other) {
  is_synchronised_ = is_synchronised_ || other.is_synchronised_;
  are_times_corrected_ = are_times_corrected_ || other.are_times_corrected_;
}

void MotionState::begin(capture::Timestamp when, const Eigen::Vector3d& position, double position_variance,
                        const Eigen::Vector3d& velocity, double velocity_variance) {
  by_nuisances_.reset();
  settle();
  at = when;
  mean_.head<3>() = position;
  mean_.segment<3>(3) = velocity;
  covariance_.leftCols<6>().setZero();
  covariance_.diagonal().head<3>().setConstant(position_variance);
  covariance_.diagonal().segment<3>(3).setConstant(velocity_variance);
  const Eigen::Index biases = 2 * static_cast<Eigen::Index>(given_.size());
  mean_.segment(bias_of(0), biases).setZero();
  covariance_.middleRows(bias_of(0), biases).setZero();
  biases_.assign(given_.size(), {});
  if (!has_size()) return;
  mean_(size_bias_at()) = 0;
  covariance_.row(size_bias_at()).setZero();
  covariance_.row(size_at()).segment(bias_of(0), biases).setZero();
  size_bias_sigma_ = size_path_m_ = 0;
}

void MotionState::reset_bias(int camera) {
  by_nuisances_.reset();
  settle();
  const Eigen::Index bias = bias_of(camera);
  mean_.segment<2>(bias).setZero();
  covariance_.middleRows<2>(bias).setZero();
  covariance_.middleCols<2>(bias).setZero();
  biases_[std::size_t(camera)] = {};
}

void MotionState::predict_to(capture::Timestamp when, double power_density) {
  const double dt = capture::seconds(when - at);
  if (dt <= 0) return;
  by_nuisances_.reset();
  at = when;
  mean_.head<3>() += dt * mean_.segment<3>(3);
  covariance_.topLeftCorner<3, 6>() += dt * covariance_.block<3, 6>(3, 0);
  covariance_.leftCols<3>() += dt * covariance_.middleCols<3>(3);
  const double path_m = dt * velocity().norm();
  for (Bias& bias : biases_) bias.path_m += path_m;
  size_path_m_ += path_m;
  const double q = power_density;
  covariance_.diagonal().head<3>().array() += q * dt * dt * dt / 3;
  covariance_.diagonal().segment<3>(3).array() += q * dt;
  covariance_.block<3, 3>(0, 3).diagonal().array() += q * dt * dt / 2;
  covariance_.block<3, 3>(3, 0).diagonal().array() += q * dt * dt / 2;
  if (!times_are_learnt_) return;
  since_shared_s_ += dt;
  for (int c = 0; c < int(given_.size()); ++c) {
    if (c != reference_camera) covariance_(latency_of(c), latency_of(c)) += motion_tuning.latency_walk_s2_per_s * dt;
  }
}

namespace {

// Subtracts (a0 a1) (b0 b1)^T from the first columns of an n x n matrix, on and below the diagonal.
HUETRACK_CLONES void take_off(double* __restrict matrix, std::ptrdiff_t n, std::ptrdiff_t columns,
                              const double* __restrict a0, const double* __restrict a1, const double* __restrict b0,
                              const double* __restrict b1) {
  for (std::ptrdiff_t i = 0; i < columns; ++i) {
    double* const column = matrix + i * n;
    const double b0_there = b0[i], b1_there = b1[i];
    for (std::ptrdiff_t j = i; j < n; ++j) column[j] -= a0[j] * b0_there + a1[j] * b1_there;
  }
}

// Subtracts a b^T, most_open columns each, below the diagonal. stride: of the matrix's columns; of_a: of a's and b's.
// With 64 cameras this is most of an update's time.
HUETRACK_CLONES void take_off_all(double* __restrict matrix, std::ptrdiff_t stride, std::ptrdiff_t n,
                                  const double* __restrict a, const double* __restrict b, std::ptrdiff_t of_a) {
  static_assert(most_open == 8);
  const double *const a0 = a, *const a1 = a + of_a, *const a2 = a + 2 * of_a, *const a3 = a + 3 * of_a;
  const double *const a4 = a + 4 * of_a, *const a5 = a + 5 * of_a, *const a6 = a + 6 * of_a, *const a7 = a + 7 * of_a;
  const auto sum = [&](std::ptrdiff_t j, const std::array<double, most_open>& b_there) {
    return ((a0[j] * b_there[0] + a1[j] * b_there[1]) + (a2[j] * b_there[2] + a3[j] * b_there[3])) +
           ((a4[j] * b_there[4] + a5[j] * b_there[5]) + (a6[j] * b_there[6] + a7[j] * b_there[7]));
  };
  // Two columns at a time share the reads of a. The last one has nothing below the diagonal.
  for (std::ptrdiff_t i = 0; i + 1 < n; i += 2) {
    double* const column = matrix + i * stride;
    double* const next_column = column + stride;
    std::array<double, most_open> b_there{}, next_b{};
    for (std::ptrdiff_t k = 0; k < most_open; ++k) {
      b_there[std::size_t(k)] = b[i + k * of_a];
      next_b[std::size_t(k)] = b[i + 1 + k * of_a];
    }
    column[i + 1] -= sum(i + 1, b_there);
    for (std::ptrdiff_t j = i + 2; j < n; ++j) {
      column[j] -= sum(j, b_there);
      next_column[j] -= sum(j, next_b);
    }
  }
}

// sums[j] += a[j] * b
HUETRACK_CLONES void add_product(double* __restrict sums, std::ptrdiff_t n, const double* __restrict a, double b) {
  for (std::ptrdiff_t j = 0; j < n; ++j) sums[j] += a[j] * b;
}

}  // namespace

void MotionState::settle() {
  if (open_ == 0) return;
  gains_.rightCols(most_open - open_).setZero();
  seen_.rightCols(most_open - open_).setZero();
  const Eigen::Index n = size();
  take_off_all(covariance_.data() + 6 * n + 6, n, n - 6, gains_.data() + 6, seen_.data() + 6, n);
  open_ = 0;
}

double MotionState::below_diagonal(Eigen::Index row, Eigen::Index column) const {
  double value = covariance_(row, column);
  for (Eigen::Index k = 0; k < open_; ++k) value -= gains_(row, k) * seen_(column, k);
  return value;
}

MotionState::WithState<2> MotionState::two_rows(Eigen::Index i) const {
  WithState<2> out(2, size());
  out.leftCols(i) = covariance_.block(i, 0, 2, i);
  out.rightCols(size() - i) = covariance_.block(i, i, size() - i, 2).transpose();
  out(1, i) = covariance_(i + 1, i);
  if (open_ == 0) return out;
  for (const Eigen::Index row : {i, i + 1}) {
    Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, most_states, 1> sums(size());
    sums.setZero();
    for (Eigen::Index k = 0; k < open_; ++k) {
      add_product(sums.data() + 6, row - 6, seen_.col(k).data() + 6, gains_(row, k));
      add_product(sums.data() + row + 1, size() - row - 1, gains_.col(k).data() + row + 1, seen_(row, k));
    }
    out.row(row - i) -= sums.transpose();
  }
  return out;
}

MotionState::WithState<3> MotionState::covariance_with_state(const SeenBy& by) const {
  const Eigen::Index rest = size() - 6;
  WithState<3> out(3, size());
  out.leftCols<6>() = covariance_.topLeftCorner<3, 6>() + by.dt * covariance_.block<3, 6>(3, 0);
  out.rightCols(rest) = (covariance_.bottomLeftCorner(rest, 3) + by.dt * covariance_.block(6, 3, rest, 3)).transpose();
  if (times_are_learnt_) {
    const WithState<2> of_times = two_rows(latency_of(by.row.camera));
    out += by.v.lazyProduct(by.row.below_middle * of_times.row(1) - of_times.row(0));
  }
  return out;
}

template <int rows>
Eigen::Matrix<double, rows, 3> MotionState::onto(const SeenBy& by, const WithState<rows>& with_state) const {
  Eigen::Matrix<double, rows, 3> out = with_state.template leftCols<3>() + by.dt * with_state.template middleCols<3>(3);
  if (times_are_learnt_) {
    const Eigen::Index latency = latency_of(by.row.camera);
    out += (by.row.below_middle * with_state.col(latency + 1) - with_state.col(latency)) * by.v.transpose();
  }
  return out;
}

Eigen::Matrix3d MotionState::unmodelled(const SeenBy& by, double power_density) const {
  const Given& given = given_[std::size_t(by.row.camera)];
  const double given_variance_s2 = given.latency_variance_s2 +
                                   by.row.below_middle * by.row.below_middle * given.readout_variance_s2 +
                                   (times_are_learnt_ ? 0.0 : relative_clock_variance_s2(by.row.camera));
  const double time_sigma_s = row_sigma_s(by.row.camera, by.row.below_middle);
  // The second order of velocity * time. Without it the noise of a resting object's velocity would pass for motion,
  // from which times are learnt.
  return given_variance_s2 * by.v * by.v.transpose() + time_sigma_s * time_sigma_s * covariance_.block<3, 3>(3, 3) +
         power_density * std::abs(by.dt * by.dt * by.dt) / 3 * Eigen::Matrix3d::Identity();
}

Eigen::Matrix3d MotionState::seen_covariance(const SeenRow& row, double power_density) const {
  const SeenBy by{row, capture::seconds(row.at - at), velocity()};
  return onto(by, covariance_with_state(by)) + unmodelled(by, power_density);
}

// First-order Gauss-Markov process along the object's path since the camera's last sighting, scaled to the standard
// deviation of now (a near object is larger, and so is its bias).
void MotionState::propagate_bias(int camera, double bias_sigma_px, const Eigen::Matrix2d& inflation) {
  const Eigen::Index bias = bias_of(camera);
  Bias& last = biases_[std::size_t(camera)];
  const double before_px = last.sigma_px;
  const double faded = std::exp(-last.path_m / motion_tuning.bias_length_m);
  double kept = 0;
  Eigen::Matrix2d added;
  if (before_px > 0 && (inflation.diagonal().any() || last.inflation.diagonal().any())) {
    // A growing inflation keeps the mean and opens it; a shrinking one takes its share of the mean along.
    const Eigen::Matrix2d one = Eigen::Matrix2d::Identity();
    const Eigen::Matrix2d now = inflation + bias_sigma_px * bias_sigma_px * one;
    const Eigen::Matrix2d before = last.inflation + before_px * before_px * one;
    kept = faded * std::sqrt(std::min(1.0, now.trace() / before.trace()));
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>().computeDirect(now - kept * kept * before);
    added = axes.eigenvectors() * axes.eigenvalues().cwiseMax(0).asDiagonal() * axes.eigenvectors().transpose();
  } else {
    kept = faded * (before_px > 0 ? bias_sigma_px / before_px : 0.0);
    const double renewed = -std::expm1(-2 * last.path_m / motion_tuning.bias_length_m);
    added = (before_px > 0 ? renewed : 1.0) * bias_sigma_px * bias_sigma_px * Eigen::Matrix2d::Identity();
    if (before_px == 0) added += inflation;
  }
  mean_.segment<2>(bias) *= kept;
  covariance_.block(bias, 0, 2, bias + 2) *= kept;
  covariance_.block(bias, bias, size() - bias, 2) *= kept;
  covariance_.block<2, 2>(bias, bias) += added;
  if (open_ > 0) {
    gains_.block(bias, 0, 2, open_) *= kept;
    seen_.block(bias, 0, 2, open_) *= kept;
  }
  last = {.sigma_px = bias_sigma_px, .inflation = inflation};
}

double MotionState::observe(const LinearSighting& sighting, const Eigen::Vector3d& velocity, double power_density) {
  by_nuisances_.reset();
  const SeenRow& row = sighting.row;
  propagate_bias(row.camera, sighting.bias_sigma_px, sighting.inflation);
  const Eigen::Index bias_at = bias_of(row.camera);
  const SeenBy by{row, capture::seconds(row.at - at), velocity};
  const double later_s = row_offset_s(row.camera, row.below_middle) - row.shift_s;
  const Eigen::Vector3d position_then = position() + by.dt * this->velocity() + later_s * velocity;
  const Eigen::Vector2d innovation = sighting.px - sighting.px_expected - bias(row.camera) -
                                     sighting.jacobian * (position_then - sighting.linearised_at);
  const Eigen::Matrix<double, 2, 3>& j = sighting.jacobian;
  const WithState<2> px_with_state = j.lazyProduct(covariance_with_state(by)) + two_rows(bias_at);
  const Eigen::Matrix2d s = onto(by, px_with_state) * j.transpose() + px_with_state.middleCols<2>(bias_at) +
                            j * unmodelled(by, power_density) * j.transpose() + sighting.covariance;
  const Eigen::Matrix2d information = s.inverse();
  const Eigen::Matrix<double, 6, 1> before = mean_.head<6>();
  apply(information.lazyProduct(px_with_state).transpose(), px_with_state.transpose(), innovation);
  if (has_size()) scale_with_distance(mean_.head<6>() - before, sighting.ray);
  return innovation.dot(information * innovation);
}

// What one camera measures, angles and a ratio of radii, says nothing of scale: if the object is by a share s farther
// than estimated, the step of position and velocity that a measurement has just caused is by s too short. Without this
// part of the covariance, a series of measurements would seem to fix the scale (Huang, Mourikis, Roumeliotis 2010: what
// is not observable must stay so). P <- T P T^T, T = I + step (ray / |ray|^2)^T.
void MotionState::scale_with_distance(const Eigen::Matrix<double, 6, 1>& step, const Eigen::Vector3d& ray) {
  const Eigen::Vector3d by = ray / ray.squaredNorm();
  const Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, most_states, 1> with_share =
      covariance_.leftCols<3>() * by;
  const Eigen::Matrix<double, 6, 1> motion_with_share = with_share.head<6>();
  covariance_.leftCols<6>() += with_share * step.transpose();
  covariance_.topLeftCorner<6, 6>() += step * (motion_with_share + by.dot(with_share.head<3>()) * step).transpose();
}

// First-order Gauss-Markov process along the path, as propagate_bias(). A constant bias and a varying one are two:
// those of a region and of an outline.
void MotionState::propagate_size_bias(double sigma, bool is_constant) {
  const Eigen::Index bias = size_bias_at();
  const bool is_first = size_bias_sigma_ == 0 || is_constant != is_size_bias_constant_;
  const double faded = is_constant ? 1.0 : std::exp(-size_path_m_ / motion_tuning.bias_length_m);
  const double kept = is_first ? 0.0 : faded * sigma / size_bias_sigma_;
  mean_(bias) *= kept;
  covariance_.row(bias) *= kept;
  covariance_(bias, bias) = covariance_(bias, bias) * kept + (is_first ? 1.0 : 1 - faded * faded) * sigma * sigma;
  size_bias_sigma_ = sigma, size_path_m_ = 0, is_size_bias_constant_ = is_constant;
}

MotionState::SizeMoments MotionState::size_moments(const SeenBy& by, const Eigen::Vector3d& ray,
                                                   double power_density) const {
  // The radius in the image is the radius over the distance.
  const Eigen::Vector3d gradient = -ray / ray.squaredNorm();
  SizeMoments out;
  const WithState<2> of_size = two_rows(size_at());
  out.with_state = gradient.transpose() * covariance_with_state(by) + of_size.colwise().sum();
  Eigen::Vector3d with_place = out.with_state.head<3>().transpose() + by.dt * out.with_state.segment<3>(3).transpose();
  if (times_are_learnt_) {
    const Eigen::Index latency = latency_of(by.row.camera);
    with_place += (by.row.below_middle * out.with_state(latency + 1) - out.with_state(latency)) * by.v;
  }
  out.variance = with_place.dot(gradient) + out.with_state(size_at()) + out.with_state(size_bias_at()) +
                 gradient.dot(unmodelled(by, power_density) * gradient);
  return out;
}

double MotionState::observe_size(const LinearSize& size, const Eigen::Vector3d& velocity, double power_density) {
  by_nuisances_.reset();
  const SeenRow& row = size.row;
  propagate_size_bias(size.bias_sigma, size.is_bias_constant);
  const SeenBy by{row, capture::seconds(row.at - at), velocity};
  const double later_s = row_offset_s(row.camera, row.below_middle) - row.shift_s;
  const Eigen::Vector3d off_place = position() + by.dt * this->velocity() + later_s * velocity - size.linearised_at;
  const double innovation =
      size.log_off - log_size() - mean_(size_bias_at()) + size.ray.dot(off_place) / size.ray.squaredNorm();
  const SizeMoments expected = size_moments(by, size.ray, power_density);
  const double s = expected.variance + size.variance;
  const double nis = innovation * innovation / s;
  const double weight = std::min(1.0, motion_tuning.size_loss / std::sqrt(nis));
  // The second one of the pair that apply() takes measures nothing.
  Columns gain = Columns::Zero(this->size(), 2), of_state = Columns::Zero(this->size(), 2);
  gain.col(0) = expected.with_state.transpose() * (weight / s);
  of_state.col(0) = expected.with_state.transpose();
  const Eigen::Matrix<double, 6, 1> before = mean_.head<6>();
  apply(gain, of_state, {innovation, 0});
  scale_with_distance(mean_.head<6>() - before, size.ray);
  return nis;
}

std::pair<double, double> MotionState::expected_log_size(const SeenRow& row, const Eigen::Vector3d& ray) const {
  const SeenBy by{row, capture::seconds(row.at - at), velocity()};
  return {log_size() + mean_(size_bias_at()), std::sqrt(std::max(0.0, size_moments(by, ray, 0).variance))};
}

void MotionState::apply(const Columns& gain, const Columns& px_of_state, const Eigen::Vector2d& innovation) {
  const Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, most_states, 1> times_before =
      covariance_.diagonal().segment(times_at, std::max<Eigen::Index>(0, times_size()));
  mean_.noalias() += gain.lazyProduct(innovation);
  const bool is_put_aside = gains_.size() > 0;
  take_off(covariance_.data(), size(), is_put_aside ? 6 : size(), gain.col(0).data(), gain.col(1).data(),
           px_of_state.col(0).data(), px_of_state.col(1).data());
  if (is_put_aside) {
    for (Eigen::Index i = 6; i < size(); ++i) covariance_(i, i) -= gain.row(i).dot(px_of_state.row(i));
    gains_.middleCols<2>(open_) = gain;
    seen_.middleCols<2>(open_) = px_of_state;
    open_ += 2;
    if (open_ == most_open) settle();
  }
  for (Eigen::Index i = 0; i < 6; ++i)
    for (Eigen::Index k = i + 1; k < 6; ++k) covariance_(i, k) = covariance_(k, i);
  if (times_are_learnt_) keep_times_open(times_before);
}

void MotionState::keep_times_open(const Eigen::Ref<const Eigen::VectorXd>& variances_before) {
  for (Eigen::Index i = 0; i < variances_before.size(); ++i) {
    // Of the readout by half of it, at the edge.
    const double least_sigma = (i % 2 == 0 ? 2 : 1) * time_prior.same_sigma_s;
    double& variance = covariance_(times_at + i, times_at + i);
    variance = std::max(variance, std::min(variances_before(i), least_sigma * least_sigma));
  }
}

Eigen::Matrix<double, 6, 6> MotionState::by_nuisances() const {
  if (by_nuisances_) return *by_nuisances_;
  if (open_ > 0) {
    MotionState settled = *this;
    settled.settle();
    return settled.by_nuisances();
  }
  const Eigen::Index n = size() - 6;
  Eigen::MatrixXd views = covariance_.bottomRightCorner(n, n);
  views.diagonal().array() += least_time_variance_s2;  // and px^2: keeps the reference latency positive definite
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> root(views);
  Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::ColMajor, most_states, 6> with_motion =
      covariance_.bottomLeftCorner(n, 6);
  for (int i = 0; i < 6; ++i) {
    auto column = with_motion.col(i);
    root.matrixL().solveInPlace(column);
  }
  return with_motion.transpose().lazyProduct(with_motion);
}

void MotionState::cache_nuisance_part() {
  by_nuisances_ = by_nuisances();
}

Eigen::Matrix3d MotionState::position_covariance_conditioned() const {
  return position_covariance() - by_nuisances().topLeftCorner<3, 3>();
}

MotionState MotionState::conditioned_on_nuisances() const {
  MotionState out = *this;
  out.by_nuisances_.reset();
  out.covariance_.topLeftCorner<6, 6>() -= by_nuisances();
  out.covariance_.bottomRows(size() - 6).setZero();
  out.open_ = 0;
  return out;
}

void MotionState::reinflate_nuisances(const MotionState& other) {
  by_nuisances_ = other.by_nuisances();
  covariance_.topLeftCorner<6, 6>() += *by_nuisances_;
  const Eigen::Index n = size() - 6;
  covariance_.bottomRows(n) = other.covariance_.bottomRows(n);
  gains_ = other.gains_, seen_ = other.seen_, open_ = other.open_;
}

void MotionState::set_position(const Eigen::Vector3d& mean, const Eigen::Matrix3d& covariance) {
  by_nuisances_.reset();
  settle();
  const Eigen::Matrix3d before = position_covariance();
  const Eigen::Index rest = size() - 3;
  WithState<3> with_position(3, rest);
  with_position.leftCols<3>() = covariance_.block<3, 3>(0, 3);
  with_position.rightCols(rest - 3) = covariance_.bottomLeftCorner(rest - 3, 3).transpose();
  const WithState<3> regression = before.inverse().lazyProduct(with_position);  // transposed
  const WithState<3> changed = (covariance - before).lazyProduct(regression);
  mean_.tail(rest) += regression.transpose().lazyProduct(mean - position());
  mean_.head<3>() = mean;
  covariance_.block<3, 3>(3, 3) += regression.leftCols<3>().transpose().lazyProduct(changed.leftCols<3>());
  covariance_.bottomLeftCorner(rest - 3, 6).rightCols<3>() +=
      regression.rightCols(rest - 3).transpose().lazyProduct(changed.leftCols<3>());
  for (Eigen::Index i = 3; i < rest; ++i)
    covariance_.col(3 + i).tail(rest - i) += regression.rightCols(rest - i).transpose().lazyProduct(changed.col(i));
  covariance_.topLeftCorner<3, 3>() = covariance;
  covariance_.bottomLeftCorner(rest, 3) = covariance.lazyProduct(regression).transpose();
  covariance_.block<3, 3>(0, 3) = covariance_.block<3, 3>(3, 0).transpose();
}

MotionState::ConditionalMeasurement MotionState::measurement_given_position(const SeenRow& row,
                                                                            double power_density) const {
  const SeenBy by{row, capture::seconds(row.at - at), velocity()};
  const WithState<3> with_state = covariance_with_state(by);
  const double later_s = row_offset_s(row.camera, row.below_middle) - row.shift_s;
  ConditionalMeasurement out;
  out.slope = with_state.leftCols<3>() * position_covariance().inverse();
  out.offset = position() + (by.dt + later_s) * by.v - out.slope * position();
  out.covariance =
      onto(by, with_state) + unmodelled(by, power_density) - out.slope * with_state.leftCols<3>().transpose();
  out.covariance = (0.5 * (out.covariance + out.covariance.transpose())).eval();
  return out;
}

}  // namespace huetrack::object_tracking
