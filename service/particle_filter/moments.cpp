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

// Some of the lanes as vectors of the machine's width.
template <int bytes>
struct Vectors {
  using Floats [[gnu::vector_size(bytes)]] = float;
  using Numbers [[gnu::vector_size(bytes)]] = std::uint32_t;
};

// n is a multiple of lanes; first: the number of the first particle. As many of the lanes at once as one vector has:
// their sums stay in registers, those of all lanes do not with AVX2.
template <int bytes>
[[gnu::always_inline]] inline void add_up_lanes(const float* x, const float* y, const float* z, const float* weight,
                                                std::size_t n, float ox, float oy, float oz, std::uint32_t first,
                                                Lanes& out) {
  using Floats = typename Vectors<bytes>::Floats;
  using Numbers = typename Vectors<bytes>::Numbers;
  constexpr std::size_t together = bytes / sizeof(float);
  Numbers numbers;
  for (std::size_t j = 0; j < together; ++j) numbers[j] = first + static_cast<std::uint32_t>(j);
  for (std::size_t lane = 0; lane < lanes; lane += together) {
    Floats sum[sums], best;
    Numbers best_at;
    for (std::size_t k = 0; k < sums; ++k) std::memcpy(&sum[k], &out.sum[k][lane], sizeof best);
    std::memcpy(&best, &out.best[lane], sizeof best);
    std::memcpy(&best_at, &out.best_at[lane], sizeof best_at);
    for (std::size_t i = lane; i < n; i += lanes) {
      Floats w, dx, dy, dz;
      std::memcpy(&w, weight + i, sizeof w);
      std::memcpy(&dx, x + i, sizeof dx), std::memcpy(&dy, y + i, sizeof dy), std::memcpy(&dz, z + i, sizeof dz);
      dx -= ox, dy -= oy, dz -= oz;
      const Floats wx = w * dx, wy = w * dy, wz = w * dz;
      sum[x_] += wx, sum[y_] += wy, sum[z_] += wz;
      sum[xx_] += wx * dx, sum[xy_] += wx * dy, sum[xz_] += wx * dz;
      sum[yy_] += wy * dy, sum[yz_] += wy * dz, sum[zz_] += wz * dz;
      const auto better = w > best;
      best_at = better ? numbers + static_cast<std::uint32_t>(i) : best_at;
      best = better ? w : best;
    }
    for (std::size_t k = 0; k < sums; ++k) std::memcpy(&out.sum[k][lane], &sum[k], sizeof best);
    std::memcpy(&out.best[lane], &best, sizeof best);
    std::memcpy(&out.best_at[lane], &best_at, sizeof best_at);
  }
}

HUETRACK_DEFAULT_VERSION void add_up(const float* x, const float* y, const float* z, const float* weight, std::size_t n,
                                     float ox, float oy, float oz, std::uint32_t first, Lanes& out) {
  add_up_lanes<16>(x, y, z, weight, n, ox, oy, oz, first, out);
}

#ifdef HUETRACK_AVX2_VERSION
HUETRACK_AVX2_VERSION void add_up(const float* x, const float* y, const float* z, const float* weight, std::size_t n,
                                  float ox, float oy, float oz, std::uint32_t first, Lanes& out) {
  add_up_lanes<32>(x, y, z, weight, n, ox, oy, oz, first, out);
}
#endif

#ifdef HUETRACK_AVX512_VERSION
HUETRACK_AVX512_VERSION void add_up(const float* x, const float* y, const float* z, const float* weight, std::size_t n,
                                    float ox, float oy, float oz, std::uint32_t first, Lanes& out) {
  add_up_lanes<64>(x, y, z, weight, n, ox, oy, oz, first, out);
}
#endif

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
