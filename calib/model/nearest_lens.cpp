#include "calib/model/nearest_lens.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <vector>

#include "calib/model/lens_derivatives.h"

namespace huetrack::calib {
namespace {

struct PixelRay {
  Eigen::Vector3d ray;
  Eigen::Vector2d px;
};

std::vector<PixelRay> rays_of(const CameraModel& lens, ImageSize size) {
  constexpr int columns = 32, rows = 24;
  std::vector<PixelRay> rays;
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      const Eigen::Vector2d px(column * (size.width - 1.0) / columns, row * (size.height - 1.0) / rows);
      if (const auto ray = lens.ray({px})) rays.push_back({*ray, px});
    }
  }
  return rays;
}

// Sum of squares and, if not null, normal equations. A ray without a pixel counts as an error of far_px.
double cost_of(const CameraModel& kind, const LensParameters& l, const std::vector<PixelRay>& rays, int free,
               Eigen::MatrixXd* normal, Eigen::VectorXd* gradient) {
  constexpr double far_px = 1e3;
  double cost = 0;
  for (const PixelRay& s : rays) {
    Eigen::Vector2d px;
    PixelByLens by_lens;
    if (!project_like(kind, l, s.ray, px, nullptr, normal ? &by_lens : nullptr)) {
      cost += far_px * far_px;
      continue;
    }
    const Eigen::Vector2d error = px - s.px;
    cost += error.squaredNorm();
    if (!normal) continue;
    *normal += by_lens.leftCols(free).transpose() * by_lens.leftCols(free);
    *gradient += by_lens.leftCols(free).transpose() * error;
  }
  return cost;
}

}  // namespace

NearestLens nearest_lens(const CameraModel& lens, ImageSize size, const CameraModel& kind, int free) {
  const std::vector<PixelRay> rays = rays_of(lens, size);
  LensParameters l = parameters_of(kind);
  l.head<4>() << lens.fx(), lens.fy(), lens.cx(), lens.cy();
  double damping = 1e-3, cost = cost_of(kind, l, rays, free, nullptr, nullptr);
  constexpr int most_steps = 200;
  for (int step = 0; step < most_steps && damping < 1e12; ++step) {
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(free, free);
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(free);
    cost_of(kind, l, rays, free, &normal, &gradient);
    normal.diagonal() *= 1 + damping;
    normal.diagonal().array() += 1e-12;
    LensParameters trial = l;
    trial.head(free) -= normal.ldlt().solve(gradient);
    const double trial_cost = trial.allFinite() ? cost_of(kind, trial, rays, free, nullptr, nullptr) : cost;
    if (trial_cost < cost) {
      const bool settled = cost - trial_cost < 1e-9 * cost;
      l = trial;
      cost = trial_cost;
      damping /= 4;
      if (settled) break;
    } else {
      damping *= 8;
    }
  }
  NearestLens result{model_like(kind, l)};
  std::vector<double> errors;
  for (const PixelRay& s : rays) {
    const auto px = result.model.project(s.ray);
    result.covers_image = result.covers_image && px.has_value();
    if (px) errors.push_back((px->px - s.px).norm());
  }
  if (errors.empty()) return result;
  std::ranges::sort(errors);
  result.p95_px = errors[static_cast<std::size_t>(0.95 * static_cast<double>(errors.size() - 1))];
  result.worst_px = errors.back();
  return result;
}

}  // namespace huetrack::calib
