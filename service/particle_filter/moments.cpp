#include "particle_filter/moments.h"

#include <algorithm>
#include <cstdint>
#include <limits>

#include "particle_filter/vector_clones.h"

namespace huetrack {
namespace {

constexpr std::size_t lanes = 16;      // sums side by side, added up in a fixed order: that is what vectorises
struct Sums { float x[lanes], y[lanes], z[lanes], xx[lanes], xy[lanes], xz[lanes], yy[lanes], yz[lanes], zz[lanes]; float best[lanes]; std::uint32_t best_at[lanes]; };

HUETRACK_CLONES void add_up(const float* __restrict x, const float* __restrict y, const float* __restrict z,
                            const float* __restrict weight, std::size_t n, float ox, float oy, float oz, Sums& out) {
  Sums s{};
  std::ranges::fill(s.best, -1.0f);
  for (std::size_t i = 0; i < n; i += lanes) {
    for (std::size_t j = 0; j < lanes; ++j) {
      const float w = weight[i + j], dx = x[i + j] - ox, dy = y[i + j] - oy, dz = z[i + j] - oz;
      const float wx = w * dx, wy = w * dy, wz = w * dz;
      s.x[j] += wx, s.y[j] += wy, s.z[j] += wz;
      s.xx[j] += wx * dx, s.xy[j] += wx * dy, s.xz[j] += wx * dz;
      s.yy[j] += wy * dy, s.yz[j] += wy * dz, s.zz[j] += wz * dz;
      s.best_at[j] = w > s.best[j] ? static_cast<std::uint32_t>(i + j) : s.best_at[j];
      s.best[j] = w > s.best[j] ? w : s.best[j];
    }
  }
  out = s;
}

}  // namespace

WeightedMoments weighted_moments(const float* x, const float* y, const float* z, const float* weight, std::size_t n,
                                 const Eigen::Vector3f& origin) {
  const std::size_t whole = n / lanes * lanes;
  Sums s;
  add_up(x, y, z, weight, whole, origin.x(), origin.y(), origin.z(), s);
  Sums rest{};
  std::ranges::fill(rest.best, -1.0f);
  if (whole < n) {
    float tail[4][lanes] = {};
    for (std::size_t i = whole; i < n; ++i) {
      tail[0][i - whole] = x[i], tail[1][i - whole] = y[i], tail[2][i - whole] = z[i], tail[3][i - whole] = weight[i];
    }
    add_up(tail[0], tail[1], tail[2], tail[3], lanes, origin.x(), origin.y(), origin.z(), rest);
  }
  const auto total = [](const float* a, const float* b) {
    double sum = 0;
    for (std::size_t j = 0; j < lanes; ++j) sum += static_cast<double>(a[j]) + static_cast<double>(b[j]);
    return sum;
  };
  const Eigen::Vector3d shift(total(s.x, rest.x), total(s.y, rest.y), total(s.z, rest.z));
  const double xy = total(s.xy, rest.xy), xz = total(s.xz, rest.xz), yz = total(s.yz, rest.yz);
  WeightedMoments out;
  out.covariance << total(s.xx, rest.xx), xy, xz, xy, total(s.yy, rest.yy), yz, xz, yz, total(s.zz, rest.zz);
  out.covariance -= shift * shift.transpose();
  out.mean = origin.cast<double>() + shift;
  float most = -1;
  for (std::size_t j = 0; j < lanes; ++j) most = std::max({most, s.best[j], rest.best[j]});
  std::uint32_t best = std::numeric_limits<std::uint32_t>::max();
  for (std::size_t j = 0; j < lanes; ++j) {
    const auto in_rest = static_cast<std::uint32_t>(whole) + rest.best_at[j];
    best = std::min({best, s.best[j] == most ? s.best_at[j] : best, rest.best[j] == most ? in_rest : best});
  }
  out.best = best < n ? best : 0;        // all NaN: the first
  return out;
}

}  // namespace huetrack
