// The ball's trajectory: a uniform cubic B-spline in time. Private to this module.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

namespace huetrack::wave {

struct BallPath {
  double start_s = 0;                    // of the first piece
  double step_s = 1;                     // > 0, between knots
  std::vector<Eigen::Vector3d> control;  // >= 4; world, metres

  // Position at a time = sum of four control points from `first`, times `weight` (sum 1).
  struct Basis {
    std::size_t first;
    std::array<double, 4> weight, weight_per_s;  // and the derivative of the weights by time
  };
  // First control point of the piece that holds t; outside of the path: of its first or last piece.
  std::size_t piece(double t_s) const;
  // Polynomial of the piece that begins at `first`; it continues beyond the piece.
  Basis basis(double t_s, std::size_t first) const;
  Eigen::Vector3d at(double t_s) const;
  Eigen::Vector3d velocity(double t_s) const;  // m/s

  static BallPath over(double from_s, double to_s, double step_s);  // all control points at the origin
};

}  // namespace huetrack::wave
