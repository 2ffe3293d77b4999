#include "camera_tracking/observation_field.h"

#include <algorithm>
#include <cmath>

#include "particle_filter/vector_clones.h"

namespace huetrack::camera_tracking {
namespace {

// out[i] = max(out[i], in[i])
HUETRACK_CLONES void take_larger(const float* __restrict in, int n, float* __restrict out) {
  for (int i = 0; i < n; ++i) out[i] = in[i] > out[i] ? in[i] : out[i];
}

// Adds the marked value at each projection; 0 outside of the region (a projection without a pixel is hugely negative).
HUETRACK_CLONES void look_up(const float* __restrict marked, float left, float top, int width, int height,
                             const float* __restrict u, const float* __restrict v, std::size_t n, bool binary,
                             float* __restrict out) {
  const float w = static_cast<float>(width), h = static_cast<float>(height);
  for (std::size_t i = 0; i < n; ++i) {
    const float x = u[i] - left, y = v[i] - top;
    const bool inside = x >= 0 && y >= 0 && x < w && y < h;
    const int at = inside ? static_cast<int>(y) * width + static_cast<int>(x) : 0;
    const float m = inside ? marked[at] : 0.0f;
    out[i] += binary ? (m > 0 ? 1.0f : 0.0f) : m;
  }
}

}  // namespace

void ObservationField::correlate(const GreyImage& image, const NccTemplate& t, const PixelRegion& region) {
  region_ = clip(region, image, t.side);
  offset_ = t.centre_offset();
  ncc_field(image, t, region_, rho_);
  marked_.clear();
  as_correlated_.clear();
}

void ObservationField::threshold(float epsilon_rho) {
  if (as_correlated_.empty()) as_correlated_ = rho_;
  for (float& r : rho_) r = r > epsilon_rho ? r : 0.0f;
}

void ObservationField::mark(float epsilon_rho, float epsilon_d) {
  marked_.assign(rho_.size(), 0.0f);
  if (region_.empty()) return;
  const int width = region_.width(), height = region_.height(), reach = static_cast<int>(epsilon_d);
  weight_.resize(rho_.size());
  bool any = false;
  for (std::size_t i = 0; i < rho_.size(); ++i) {
    weight_[i] = rho_[i] > epsilon_rho ? rho_[i] : 0.0f;
    any = any || weight_[i] > 0;
  }
  if (!any) return;
  for (int dv = -reach; dv <= reach; ++dv) {
    const int du = static_cast<int>(std::sqrt(epsilon_d * epsilon_d - static_cast<float>(dv * dv)));
    for (int v = std::max(0, -dv); v < std::min(height, height - dv); ++v) {
      const float* from = weight_.data() + (v + dv) * width;
      float* to = marked_.data() + v * width;
      for (int s = -du; s <= du; ++s) {
        const int first = std::max(0, -s), count = std::min(width, width - s) - first;
        if (count > 0) take_larger(from + first + s, count, to + first);
      }
    }
  }
}

void ObservationField::score(std::span<const float> u, std::span<const float> v, bool binary,
                             std::span<float> log_weight) const {
  if (marked_.empty()) return;
  // Shifted so that truncation rounds to the nearest anchor.
  look_up(marked_.data(), static_cast<float>(region_.u0) + offset_ - 0.5f,
          static_cast<float>(region_.v0) + offset_ - 0.5f, region_.width(), region_.height(), u.data(), v.data(),
          u.size(), binary, log_weight.data());
}

void ObservationField::reweight(std::span<const float> u, std::span<const float> v, std::span<const float> weight,
                                float epsilon_d) {
  if (region_.empty()) return;
  const int width = region_.width(), height = region_.height();
  weight_.assign(rho_.size(), 0.0f);
  const int reach = static_cast<int>(std::ceil(epsilon_d));
  for (std::size_t i = 0; i < u.size(); ++i) {
    if (!(u[i] > -1e6f)) continue;
    const float x = u[i] - static_cast<float>(region_.u0) - offset_,
                y = v[i] - static_cast<float>(region_.v0) - offset_;
    if (!(x > -16 && y > -16 && x < static_cast<float>(width + 16) && y < static_cast<float>(height + 16))) continue;
    const int cu = static_cast<int>(std::lround(x)), cv = static_cast<int>(std::lround(y));
    for (int b = std::max(0, cv - reach); b <= std::min(height - 1, cv + reach); ++b) {
      for (int a = std::max(0, cu - reach); a <= std::min(width - 1, cu + reach); ++a) {
        const float du = static_cast<float>(a) - x, dv = static_cast<float>(b) - y;
        if (du * du + dv * dv <= epsilon_d * epsilon_d) weight_[static_cast<std::size_t>(b * width + a)] += weight[i];
      }
    }
  }
  const float most = *std::ranges::max_element(weight_);
  if (!(most > 0)) return;
  for (std::size_t i = 0; i < rho_.size(); ++i) rho_[i] *= weight_[i] / most;
}

std::optional<Eigen::Vector2d> ObservationField::best_match(const Eigen::Vector2d& px, double radius,
                                                            float epsilon_rho) const {
  const std::vector<float>& field = as_correlated_.empty() ? rho_ : as_correlated_;
  NccPeak best{epsilon_rho, 0, 0};
  bool any = false;
  for (int v = region_.v0; v <= region_.v1; ++v) {
    for (int u = region_.u0; u <= region_.u1; ++u) {
      const float rho = field[region_.index(u, v)];
      const Eigen::Vector2d off = Eigen::Vector2d(u, v).array() + static_cast<double>(offset_) - px.array();
      if (rho > best.rho && off.squaredNorm() <= radius * radius) best = {rho, u, v}, any = true;
    }
  }
  if (!any) return std::nullopt;
  return refined(best, field, region_).array() + static_cast<double>(offset_);
}

NccPeak ObservationField::strongest(float u, float v, float radius, float epsilon_rho) const {
  NccPeak best{0, 0, 0};
  if (region_.empty()) return best;
  const float x = u - offset_, y = v - offset_;
  const int reach = static_cast<int>(std::ceil(radius));
  const int cu = static_cast<int>(std::lround(x)), cv = static_cast<int>(std::lround(y));
  for (int b = std::max(region_.v0, cv - reach); b <= std::min(region_.v1, cv + reach); ++b) {
    for (int a = std::max(region_.u0, cu - reach); a <= std::min(region_.u1, cu + reach); ++a) {
      const float du = static_cast<float>(a) - x, dv = static_cast<float>(b) - y;
      if (du * du + dv * dv > radius * radius) continue;
      const float rho = rho_[region_.index(a, b)];
      if (rho > epsilon_rho && rho > best.rho) best = {rho, a, b};
    }
  }
  return best;
}

}  // namespace huetrack::camera_tracking
