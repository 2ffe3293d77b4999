// Normal equations of a Gauss-Newton step, eliminated from the last unknown to the first, so that the covariance of the
// first ones is marginal over the others. Not positive definite: is_sound() is false.
#pragma once

#include <optional>

#include "outline/edge_model.h"

namespace huetrack::outline {

using LightMatrix = Eigen::Matrix<double, lights, lights>;

// size: unknowns; reported: how many of the first ones get a covariance.
template <int size, int reported>
class NormalEquations {
 public:
  using Matrix = Eigen::Matrix<double, size, size>;
  using Vector = Eigen::Matrix<double, size, 1>;
  using Reported = Eigen::Matrix<double, reported, reported>;

  // information: of the prior.
  void eliminate(const Matrix& normal, const Matrix& information);
  bool is_sound() const { return is_sound_; }
  // May be repeated with other right sides.
  void solve(const Vector& right, Vector& out) const;
  // Marginal covariance of the reported unknowns.
  const Reported& covariance() const { return covariance_; }
  // Marginal covariance of shading and paleness; takes as long as eliminate().
  LightMatrix covariance_of_light() const requires(size == unknowns);

 private:
  static constexpr int width = (size + 7) / 8 * 8;  // layout: whole vectors
  alignas(64) double factors_[size][width] = {};
  double pivots_[size] = {};
  Reported covariance_ = Reported::Identity();
  bool is_sound_ = false;
};

// nullopt: not positive definite.
std::optional<LightMatrix> inverse_of(const LightMatrix& matrix);

}  // namespace huetrack::outline
