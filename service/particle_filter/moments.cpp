#include "particle_filter/moments.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>

#include "particle_filter/vector_clones.h"

namespace huetrack::particle_filter {
namespace {

constexpr std::size_t lanes = 16;  // sums side by side, added up in a fixed order: that is what vectorises
enum { x_, y_, z_, xx_, xy_, xz_, yy_, yz_, zz_, sums };
struct Lanes {
  float sum[sums][lanes] = {};
  float best[lanes];
  std::uint32_t best_at[lanes] = {};
  Lanes() { std::ranges::fill(best, -1.0f); }
};

// n is a multiple of lanes; first: the number of the first particle.
HUETRACK_CLONES void add_up(const float* __restrict x, const float* __restrict y, const float* __restrict z,
                            const float* __restrict weight, std::size_t n, float ox, float oy, float oz,
                            std::uint32_t first, Lanes& out) {
  Lanes s = out;
  for (std::size_t i = 0; i < n; i += lanes) {
    for (std::size_t j = 0; j < lanes; ++j) {
      const float w = weight[i + j], dx = x[i + j] - ox, dy = y[i + j] - oy, dz = z[i + j] - oz;
      const float wx = w * dx, wy = w * dy, wz = w * dz;
      s.sum[x_][j] += wx, s.sum[y_][j] += wy, s.sum[z_][j] += wz;
      s.sum[xx_][j] += wx * dx, s.sum[xy_][j] += wx * dy, s.sum[xz_][j] += wx * dz;
      s.sum[yy_][j] += wy * dy, s.sum[yz_][j] += wy * dz, s.sum[zz_][j] += wz * dz;
      s.best_at[j] = w > s.best[j] ? first + static_cast<std::uint32_t>(i + j) : s.best_at[j];
      s.best[j] = w > s.best[j] ? w : s.best[j];
    }
  }
  out = s;
}

// Halves onto halves.
HUETRACK_CLONES void total(const Lanes& s, double* __restrict out) {
  for (std::size_t k = 0; k < sums; ++k) {
    double t[lanes];
    for (std::size_t j = 0; j < lanes; ++j) t[j] = static_cast<double>(s.sum[k][j]);
    for (std::size_t j = 0; j < 8; ++j) t[j] += t[j + 8];
    for (std::size_t j = 0; j < 4; ++j) t[j] += t[j + 4];
    out[k] = (t[0] + t[2]) + (t[1] + t[3]);
  }
}

// The first of the largest weights. Weights are >= 0 (and -1 where a lane has none): their bits compare as they do.
HUETRACK_CLONES std::uint32_t best_of(const Lanes& s) {
  std::int32_t bits[lanes];
  std::memcpy(bits, s.best, sizeof s.best);
  std::int32_t most = bits[0];
  for (const std::int32_t candidate : bits) most = std::max(most, candidate);
  constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  std::uint32_t first = none;
  for (std::size_t j = 0; j < lanes; ++j) first = std::min(first, bits[j] == most ? s.best_at[j] : none);
  return first;
}

}  // namespace

WeightedMoments weighted_moments(const float* x, const float* y, const float* z, const float* weight, std::size_t n,
                                 const Eigen::Vector3f& origin) {
  const std::size_t whole = n / lanes * lanes;
  Lanes s;
  add_up(x, y, z, weight, whole, origin.x(), origin.y(), origin.z(), 0, s);
  if (whole < n) {
    float tail[4][lanes] = {};
    for (std::size_t i = whole; i < n; ++i) {
      tail[0][i - whole] = x[i], tail[1][i - whole] = y[i], tail[2][i - whole] = z[i], tail[3][i - whole] = weight[i];
    }
    add_up(tail[0], tail[1], tail[2], tail[3], lanes, origin.x(), origin.y(), origin.z(),
           static_cast<std::uint32_t>(whole), s);
  }
  double t[sums];
  total(s, t);
  const Eigen::Vector3d shift(t[x_], t[y_], t[z_]);
  WeightedMoments out;
  out.covariance << t[xx_], t[xy_], t[xz_], t[xy_], t[yy_], t[yz_], t[xz_], t[yz_], t[zz_];
  out.covariance -= shift * shift.transpose();
  out.mean = origin.cast<double>() + shift;
  const std::uint32_t best = best_of(s);
  out.best = best < n ? best : 0;  // all NaN: the first
  return out;
}

}  // namespace huetrack::particle_filter
