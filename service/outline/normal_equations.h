// The equations of a step of Gauss and Newton, solved by elimination from the last unknown to the first, so that what
// is told of the first ones remains when the others are gone. Symmetric and positive definite, or is_sound() is false.
#pragma once

#include <optional>

#include "outline/edge_model.h"

namespace huetrack::outline {

using LightMatrix = Eigen::Matrix<double, lights, lights>;

// size: unknowns, of which so many are told.
template <int size, int told>
class NormalEquations {
 public:
  using Matrix = Eigen::Matrix<double, size, size>;
  using Vector = Eigen::Matrix<double, size, 1>;
  using Told = Eigen::Matrix<double, told, told>;

  // information: of what is known beforehand.
  void eliminate(const Matrix& normal, const Matrix& information);
  bool is_sound() const { return is_sound_; }
  // For another right side of the same equations, too.
  void solve(const Vector& right, Vector& out) const;
  // Of those unknowns that are told, whatever the others are.
  const Told& covariance() const { return covariance_; }
  // And of the light over the ball, which takes as long as the equations themselves.
  LightMatrix covariance_of_light() const requires(size == unknowns);

 private:
  static constexpr int width = (size + 7) / 8 * 8;  // so that no loop over a row has a rest
  alignas(64) double factors_[size][width] = {};
  double pivots_[size] = {};
  Told covariance_ = Told::Identity();
  bool is_sound_ = false;
};

// nullopt: it is not positive definite.
std::optional<LightMatrix> inverse_of(const LightMatrix& matrix);

}  // namespace huetrack::outline
