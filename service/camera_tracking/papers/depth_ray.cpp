#include "camera_tracking/papers/depth_ray.h"

#include <cmath>

#include "calib/model/closest_approach.h"

namespace huetrack::papers {

DepthRay::DepthRay(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double near_m, double far_m,
                   int bins)
    : origin_(origin),
      direction_(direction.normalized()),
      least_(1 / far_m),
      step_((1 / near_m - 1 / far_m) / bins),
      weight_(static_cast<std::size_t>(bins), 1.0 / bins),
      gained_(static_cast<std::size_t>(bins), 0.0) {}

void DepthRay::add(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double weight, double sigma_rad) {
  const Eigen::Vector3d between = origin_ - origin;
  const auto nearest = calib::closest_approach(-between, direction_, direction, 2e-5);
  if (!nearest) return;  // 0.25 degrees: parallel
  const double depth = nearest->along_0, other = nearest->along_1;
  if (!(depth > 0) || !(other > 0)) return;
  const double p = (between + depth * direction_ - other * direction).norm(), sigma = sigma_rad * other;
  const double w = weight * std::exp(-0.5 * p * p / (sigma * sigma));
  const double at = (1 / depth - least_) / step_ - 0.5;
  // The error of one pixel along the ray: the resolution of one crossing ray.
  const double error = sigma_rad / std::sqrt(nearest->sin2) * other / (depth * depth);
  const double blur = std::max(1.0, error / step_);
  if (p < 2 * sigma) finest_ = std::min(finest_, error);
  const int reach = static_cast<int>(std::min(2 * blur, 30.0));
  const int middle = static_cast<int>(std::lround(at));
  for (int i = middle - reach; i <= middle + reach; ++i) {
    if (i < 0 || i >= static_cast<int>(gained_.size())) continue;
    const double d = (i - at) / blur;
    gained_[static_cast<std::size_t>(i)] += w * std::exp(-0.5 * d * d) / blur;
  }
}

bool DepthRay::end() {
  const double most = *std::ranges::max_element(gained_);
  if (!(most > 1e-12)) return false;
  double sum = 0;
  for (std::size_t i = 0; i < weight_.size(); ++i) sum += weight_[i] *= 0.1 + gained_[i] / most;
  for (double& w : weight_) w /= sum;
  ++frames_;
  return true;
}

std::pair<double, double> DepthRay::interval(double tail) const {
  double first = 0, last = 0, cumulative = 0;
  for (std::size_t b = 0; b < weight_.size(); ++b) {
    if (cumulative <= tail) first = inverse_depth(b);
    cumulative += weight_[b];
    if (cumulative <= 1 - tail) last = inverse_depth(b);
  }
  return {first, std::max(last, first)};
}

std::optional<DepthRay::Estimate> DepthRay::converged() const {
  if (frames_ < 4) return std::nullopt;
  const auto mode = static_cast<std::size_t>(std::ranges::max_element(weight_) - weight_.begin());
  constexpr double finest_share = 0.03;
  if (finest_ > finest_share * inverse_depth(mode)) return std::nullopt;
  const double reach = std::max(0.1 * inverse_depth(mode), 3 * step_);
  double mass = 0, mean = 0, square = 0;
  for (std::size_t i = 0; i < weight_.size(); ++i) {
    const double d = inverse_depth(i) - inverse_depth(mode);
    if (std::abs(d) > reach) continue;
    mass += weight_[i], mean += weight_[i] * d, square += weight_[i] * d * d;
  }
  if (mass < 0.9 || mode == 0 || mode + 1 == weight_.size()) return std::nullopt;
  mean /= mass, square /= mass;
  return Estimate{inverse_depth(mode) + mean, std::sqrt(std::max(square - mean * mean, step_ * step_ / 12))};
}

}  // namespace huetrack::papers
