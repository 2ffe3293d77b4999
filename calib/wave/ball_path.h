// The way that the ball took: a uniform cubic B-spline in time. Private to this module.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

namespace huetrack::wave {

struct BallPath {
  double start_s = 0;                    // the path is defined from here
  double step_s = 1;                     // > 0, between knots
  std::vector<Eigen::Vector3d> control;  // >= 4; world

  // The four control points that make the position at t, from `first`, and their weights (their sum is 1).
  struct Basis {
    std::size_t first;
    std::array<double, 4> weight;
  };
  Basis basis(double t_s) const;  // t is clamped to the path
  Eigen::Vector3d at(double t_s) const;
  double end_s() const { return start_s + step_s * static_cast<double>(control.size() - 3); }

  static BallPath over(double from_s, double to_s, double step_s);  // all control points at the origin
};

}  // namespace huetrack::wave
