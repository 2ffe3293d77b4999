#include "calib/wave/ball_path.h"

#include <algorithm>
#include <cmath>

namespace huetrack::wave {

BallPath BallPath::over(double from_s, double to_s, double step_s) {
  BallPath path;
  path.start_s = from_s;
  path.step_s = step_s;
  const auto spans = static_cast<std::size_t>(std::max(1.0, std::ceil((to_s - from_s) / step_s)));
  path.control.assign(spans + 3, Eigen::Vector3d::Zero());
  return path;
}

std::size_t BallPath::piece(double t_s) const {
  const auto last = static_cast<double>(control.size() - 4);
  return static_cast<std::size_t>(std::clamp(std::floor((t_s - start_s) / step_s), 0.0, last));
}

BallPath::Basis BallPath::basis(double t_s, std::size_t first) const {
  const double u = (t_s - start_s) / step_s - static_cast<double>(first), v = 1 - u;
  const double slope = 1 / (2 * step_s);
  return {
      first,
      {v * v * v / 6, (3 * u * u * u - 6 * u * u + 4) / 6, (-3 * u * u * u + 3 * u * u + 3 * u + 1) / 6, u * u * u / 6},
      {-v * v * slope, (3 * u * u - 4 * u) * slope, (-3 * u * u + 2 * u + 1) * slope, u * u * slope}};
}

Eigen::Vector3d BallPath::at(double t_s) const {
  const Basis b = basis(t_s, piece(t_s));
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < 4; ++k) p += b.weight[k] * control[b.first + k];
  return p;
}

Eigen::Vector3d BallPath::velocity(double t_s) const {
  const Basis b = basis(t_s, piece(t_s));
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < 4; ++k) v += b.weight_per_s[k] * control[b.first + k];
  return v;
}

}  // namespace huetrack::wave
