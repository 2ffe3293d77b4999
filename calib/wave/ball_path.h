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

  // The four control points that make the position at t, from `first`, their weights (their sum is 1), and what these
  // change by per second.
  struct Basis {
    std::size_t first;
    std::array<double, 4> weight, weight_per_s;
  };
  // The control points whose piece of the path t is in; before and after the path those of its ends.
  std::size_t piece(double t_s) const;
  // The polynomial of that piece, which goes on beyond it.
  Basis basis(double t_s, std::size_t first) const;
  Eigen::Vector3d at(double t_s) const;
  Eigen::Vector3d velocity(double t_s) const;  // m/s

  static BallPath over(double from_s, double to_s, double step_s);  // all control points at the origin
};

}  // namespace huetrack::wave
