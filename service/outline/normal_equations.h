// The equations of a step of Gauss and Newton, solved by elimination from the last unknown to the first, so that what
// is told of the first ones remains when the others are gone. Symmetric and positive definite, or is_sound() is false.
#pragma once

#include "outline/edge_model.h"

namespace huetrack::outline {

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

 private:
  static constexpr int lanes = 8, width = (unknowns + lanes - 1) / lanes * lanes;
  void find_covariance();

  alignas(64) double factors_[unknowns][width] = {};  // row k: by how much of equation k those before it are less
  double pivots_[unknowns] = {};
  Told covariance_ = Told::Identity();
  bool is_sound_ = false;
};

}  // namespace huetrack::outline
