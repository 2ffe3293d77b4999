#include "calib/wave/flight_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace huetrack::wave {
namespace {

using Eigen::Index;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix9d = Eigen::Matrix<double, 9, 9>;

struct AirTuning {
  double kg_m3 = 1.2;               // at 20 degrees and 100 kPa
  double drag_coefficient = 0.47;   // of a sphere, Reynolds numbers of 10^3 to 10^5
  double coefficient_sigma = 0.15;  // relative: between a smooth and a rough ball
  // Air over ball, mean and 1 sigma: table tennis 0.014, tennis 0.0033, rubber 0.001.
  double over_ball = 0.004, over_ball_sigma = 0.006;
  double lift_over_drag = 0.2;  // 1 sigma: a ball thrown by hand turns a few times per second
};
constexpr AirTuning air_tuning;
constexpr double flight_loss = 3;   // Cauchy's, standard deviations
constexpr double most_square = 25;  // of one outline: an outlier is not the flight's misfit

}  // namespace

double Air::drag() const {
  return 3 * air_tuning.drag_coefficient * over_ball / (8 * radius * (1 + over_ball / 2));
}

Air Air::before(const FlightOptions& options) {
  return {options.density_kg_m3 ? air_tuning.kg_m3 / *options.density_kg_m3 : air_tuning.over_ball, options.radius};
}

FlightFit::FlightFit(const std::vector<PathMeasurement>& measurements, std::vector<Flight> flights,
                     const Vector3d& acceleration, const FlightOptions& options)
    : measurements_(&measurements),
      before_(Air::before(options)),
      air_sigma_(options.density_kg_m3 ? air_tuning.coefficient_sigma * before_.over_ball : air_tuning.over_ball_sigma),
      frames_as_one_(options.frames_as_one) {
  common_ << acceleration, before_.over_ball;
  for (Flight& flight : flights) start(flights_.emplace_back(OneFlight{.flight = std::move(flight)}));
  constexpr int rounds = 12;  // experiment: three are enough without outliers
  for (int round = 0; round < rounds; ++round) step();
}

std::pair<std::size_t, double> FlightFit::worst() const {
  std::pair<std::size_t, double> worst{0, -1e9};
  for (std::size_t f = 0; f < flights_.size(); ++f) {
    const auto freedom = static_cast<double>(2 * flights_[f].flight.measurements.size()) - 6;
    const double excess = (flights_[f].squares - freedom) / std::sqrt(2 * freedom * frames_as_one_);
    if (excess > worst.second) worst = {f, excess};
  }
  return worst;
}

Gravity FlightFit::gravity() const {
  Gravity out{.acceleration = acceleration(),
              .flights = {},
              .air_over_ball = common_[3],
              .misfit = 0,
              .gain = Eigen::MatrixXd::Zero(3, 2 * static_cast<Index>(measurements_->size()))};
  const Vector3d by_air = covariance_.col(3).head<3>() / air_sigma_;
  out.by_priors = by_air * by_air.transpose();
  std::size_t freedom = 0;
  for (const OneFlight& of : flights_) {
    out.misfit += of.squares, freedom += 2 * of.flight.measurements.size() - 6;
    const Eigen::MatrixXd gain = covariance_.topRows<3>() * of.by_common.transpose();
    for (std::size_t k = 0; k < of.root_weights.size(); ++k)
      out.gain.middleCols<2>(2 * static_cast<Index>(of.flight.measurements[k])) =
          of.root_weights[k] * gain.middleCols<2>(2 * static_cast<Index>(k));
    out.by_priors += gain.rightCols<3>() * gain.rightCols<3>().transpose();
    out.flights.push_back(of.flight);
  }
  out.misfit /= static_cast<double>(freedom);
  return out;
}

// Without drag.
void FlightFit::start(OneFlight& of) const {
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
  for (const std::size_t i : of.flight.measurements) {
    const PathMeasurement& m = (*measurements_)[i];
    const double t = m.t_s - of.flight.from_s;
    Eigen::Matrix<double, 2, 6> j;
    j << m.by_position, t * m.by_position;
    information += j.transpose() * j;
    right += j.transpose() * (m.value - t * t / 2 * m.by_position * common_.head<3>());
  }
  of.own << information.ldlt().solve(right), Vector3d::Zero();
}

// At the flight's measurements (midpoint rule).
std::vector<Vector3d> FlightFit::positions(const OneFlight& of, const Common& common, const Vector9d& own) const {
  constexpr double step_s = 5e-3;
  const Air air{common[3], before_.radius};
  const Vector3d constant = air.weight() * common.head<3>() + own.tail<3>();
  const double drag = air.drag();
  const auto acceleration = [&](const Vector3d& v) -> Vector3d { return constant - drag * v.norm() * v; };
  Vector3d p = own.head<3>(), v = own.segment<3>(3);
  double t = of.flight.from_s;
  std::vector<Vector3d> out;
  for (const std::size_t i : of.flight.measurements) {
    const int steps = 1 + static_cast<int>(((*measurements_)[i].t_s - t) / step_s);
    const double h = ((*measurements_)[i].t_s - t) / steps;
    for (int k = 0; k < steps; ++k) {
      const Vector3d middle = v + h / 2 * acceleration(v);
      p += h * middle;
      v += h * acceleration(middle);
    }
    t = (*measurements_)[i].t_s;
    out.push_back(p);
  }
  return out;
}

void FlightFit::linearise(OneFlight& of) const {
  const std::vector<std::size_t>& seen = of.flight.measurements;
  const auto rows = 2 * static_cast<Index>(seen.size());
  const std::vector<Vector3d> at = positions(of, common_, of.own);
  of.by_common = Eigen::MatrixXd::Zero(rows + 3, 4), of.by_own = Eigen::MatrixXd::Zero(rows + 3, 9);
  of.residual.resize(rows + 3);
  constexpr double tiny = 1e-4;
  for (int column = 0; column < 13; ++column) {
    Common common = common_;
    Vector9d own = of.own;
    (column < 4 ? common[column] : own[column - 4]) += tiny;
    const std::vector<Vector3d> there = positions(of, common, own);
    auto to = column < 4 ? of.by_common.col(column) : of.by_own.col(column - 4);
    for (std::size_t k = 0; k < seen.size(); ++k)
      to.segment<2>(2 * static_cast<Index>(k)) = (*measurements_)[seen[k]].by_position * (there[k] - at[k]) / tiny;
  }
  of.squares = 0;
  of.root_weights.clear();
  double speed2 = 0;
  for (std::size_t k = 0; k < seen.size(); ++k) {
    const PathMeasurement& m = (*measurements_)[seen[k]];
    const Vector2d residual = m.value - m.by_position * at[k];
    const double weight =
        of.root_weights.emplace_back(1 / std::sqrt(1 + residual.squaredNorm() / (flight_loss * flight_loss)));
    const auto row = 2 * static_cast<Index>(k);
    of.squares += std::min(residual.squaredNorm(), most_square);
    of.by_common.middleRows<2>(row) *= weight, of.by_own.middleRows<2>(row) *= weight;
    of.residual.segment<2>(row) = weight * residual;
    const Vector3d velocity = of.own.segment<3>(3) + (m.t_s - of.flight.from_s) * common_.head<3>();
    speed2 += velocity.squaredNorm() / static_cast<double>(seen.size());
  }
  constexpr double least = 1e-4;  // of gravity
  const double lift =
      std::max(least * common_.head<3>().norm(), air_tuning.lift_over_drag * std::abs(air().drag()) * speed2);
  of.by_own.bottomRightCorner<3, 3>().diagonal().setConstant(1 / lift);
  of.residual.tail<3>() = -of.own.tail<3>() / lift;
}

void FlightFit::step() {
  Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
  Common right = Common::Zero();
  information(3, 3) = 1 / (air_sigma_ * air_sigma_);
  right[3] = (before_.over_ball - common_[3]) / (air_sigma_ * air_sigma_);
  std::vector<Eigen::LDLT<Matrix9d>> solvers;
  std::vector<Eigen::MatrixXd> own_by_common;
  for (OneFlight& of : flights_) {
    linearise(of);
    const auto& solver = solvers.emplace_back(Matrix9d(of.by_own.transpose() * of.by_own));
    const auto& own = own_by_common.emplace_back(solver.solve(Eigen::MatrixXd(of.by_own.transpose() * of.by_common)));
    of.by_common -= of.by_own * own;  // Schur complement
    information += of.by_common.transpose() * of.by_common;
    right += of.by_common.transpose() * of.residual;
  }
  covariance_ = information.inverse();
  const Common by = covariance_ * right;
  common_ += by;
  for (std::size_t f = 0; f < flights_.size(); ++f) {
    OneFlight& of = flights_[f];
    of.own += solvers[f].solve(Vector9d(of.by_own.transpose() * of.residual)) - own_by_common[f] * by;
  }
}

}  // namespace huetrack::wave
