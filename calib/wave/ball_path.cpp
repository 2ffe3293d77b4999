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

BallPath::Basis BallPath::basis(double t_s) const {
  const auto spans = static_cast<double>(control.size() - 3);
  const double s = std::clamp((t_s - start_s) / step_s, 0.0, spans);
  const double whole = std::min(std::floor(s), spans - 1);
  const double u = s - whole, v = 1 - u;
  return {static_cast<std::size_t>(whole),
          {v * v * v / 6, (3 * u * u * u - 6 * u * u + 4) / 6, (-3 * u * u * u + 3 * u * u + 3 * u + 1) / 6,
           u * u * u / 6}};
}

Eigen::Vector3d BallPath::at(double t_s) const {
  const Basis b = basis(t_s);
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < 4; ++k) p += b.weight[k] * control[b.first + k];
  return p;
}

}  // namespace huetrack::wave
