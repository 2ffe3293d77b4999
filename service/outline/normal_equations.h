// The equations of a step of Gauss and Newton, solved by elimination from the last unknown to the first, so that what
// is told of the first ones remains when the others are gone. Symmetric and positive definite, or is_sound() is false.
#pragma once

#include <optional>

#include "outline/edge_model.h"

namespace huetrack::outline {

using LightMatrix = Eigen::Matrix<double, lights, lights>;

class NormalEquations {
 public:
  using Told = Eigen::Matrix<double, told_unknowns, told_unknowns>;

  // information: of what is known beforehand.
  void eliminate(const Normal& normal, const Normal& information);
  bool is_sound() const { return is_sound_; }
  // For another right side of the same equations, too.
  void solve(const Unknowns& right, Unknowns& out) const;
  // Of those unknowns that are told, whatever the others are.
  const Told& covariance() const { return covariance_; }
  // And of the light over the ball, which takes as long as the equations themselves.
  LightMatrix covariance_of_light() const;

 private:
  static constexpr int width = 24;
  alignas(64) double factors_[unknowns][width] = {};
  double pivots_[unknowns] = {};
  Told covariance_ = Told::Identity();
  bool is_sound_ = false;
};

// nullopt: it is not positive definite.
std::optional<LightMatrix> inverse_of(const LightMatrix& matrix);

}  // namespace huetrack::outline
