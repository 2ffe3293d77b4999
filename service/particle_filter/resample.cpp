#include "particle_filter/resample.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>

#include "particle_filter/vector_clones.h"

#ifdef HUETRACK_AVX512_VERSION
#include <immintrin.h>
#endif

namespace huetrack::particle_filter {

namespace {

// In eight sums side by side, added up in a fixed order: that is what vectorises.
template <typename Term>
[[gnu::always_inline]] inline double sum_of(std::span<const float> values, Term term) {
  double sums[8] = {};
  const std::size_t whole = values.size() / 8 * 8;
  for (std::size_t i = 0; i < whole; i += 8) {
    for (std::size_t j = 0; j < 8; ++j) sums[j] += term(static_cast<double>(values[i + j]));
  }
  for (std::size_t i = whole; i < values.size(); ++i) sums[i - whole] += term(static_cast<double>(values[i]));
  return ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
}

HUETRACK_CLONES double sum(std::span<const float> values) {
  return sum_of(values, [](double w) { return w; });
}
HUETRACK_CLONES double sum_of_squares(std::span<const float> values) {
  return sum_of(values, [](double w) { return w * w; });
}

// The number of teeth (offset + i) / count below a cumulative weight: ceil(cumulative * count - offset), at least 0.
HUETRACK_CLONES void teeth_below(const double* __restrict cumulative, std::size_t n, double base, double count,
                                 double offset, std::int32_t* __restrict below) {
  for (std::size_t i = 0; i < n; ++i) {
    const double teeth = std::min(count, std::max(0.0, (base + cumulative[i]) * count - offset));
    const auto whole = static_cast<std::int32_t>(teeth);
    below[i] = whole + (static_cast<double>(whole) < teeth ? 1 : 0);
  }
}

}  // namespace

bool normalize_weights(std::span<float> weight) {
  const double total = sum(weight);
  if (!(total > 0)) {
    std::ranges::fill(weight, 1.0f / static_cast<float>(weight.size()));
    return false;
  }
  if (total < 1e-30) {  // its inverse may be beyond a float
    for (float& w : weight) w *= 0x1p100f;
    return normalize_weights(weight);
  }
  const auto scale = static_cast<float>(1.0 / total);
  for (float& w : weight) w *= scale;
  return true;
}

namespace {

// e^(x - largest), where that is at most 1, to some 3e-7 of it; 0 below e^-87. By a polynomial, so that it is done for
// many at once.
HUETRACK_CLONES void fill_exponentials(const float* __restrict x, float largest, std::size_t n, float* __restrict out) {
  constexpr float least = -87.f, per_ln2 = 1.44269504f, ln2_high = 0.693359375f, ln2_low = -2.12194440e-4f;
  for (std::size_t i = 0; i < n; ++i) {
    const float given = x[i] - largest, y = given >= least ? given : least;
    const float halves = y * per_ln2 - 0.5f;
    const auto twos = static_cast<std::int32_t>(halves);  // towards 0, and y is not above it: the nearest
    const auto t = static_cast<float>(twos);
    const float r = y - t * ln2_high - t * ln2_low;
    const float series = 1 + r * (1 + r * (0.5f + r * (1.f / 6 + r * (1.f / 24 + r * (1.f / 120 + r * (1.f / 720))))));
    const float power = std::bit_cast<float>((twos + 127) << 23);
    out[i] = given >= least ? series * power : given < least ? 0 : given;  // what is no number stays that
  }
}

}  // namespace

bool normalize_log_weights(std::span<const float> log_weight, std::span<float> weight) {
  const float largest = *std::ranges::max_element(log_weight);
  if (!std::isfinite(largest)) {
    std::ranges::fill(weight, 1.0f / static_cast<float>(weight.size()));
    return false;
  }
  fill_exponentials(log_weight.data(), largest, weight.size(), weight.data());
  return normalize_weights(weight);
}

double effective_sample_size(std::span<const float> weight) {
  return std::clamp(1.0 / sum_of_squares(weight), 1.0, static_cast<double>(weight.size()));
}

namespace {

// descendants_to[i]: how many of `count` new particles descend from particles 0 .. i. In blocks; of each the weights
// are summed up in four parts side by side, as a sum waits for the one before it.
void systematic_descendants(std::span<const float> weight, double offset, std::size_t count,
                            std::int32_t* descendants_to) {
  constexpr std::size_t block = 256, parts = 4;
  std::array<double, block> cumulative;
  double sum = 0;
  for (std::size_t from = 0; from < weight.size(); from += block) {
    const std::size_t size = std::min(block, weight.size() - from);
    const std::size_t part = size / parts;
    const float* const w = &weight[from];
    double sums[parts] = {};
    for (std::size_t i = 0; i < part; ++i) {
      for (std::size_t p = 0; p < parts; ++p)
        cumulative[p * part + i] = sums[p] += static_cast<double>(w[p * part + i]);
    }
    for (std::size_t i = parts * part; i < size; ++i) cumulative[i] = sums[parts - 1] += static_cast<double>(w[i]);
    for (std::size_t p = 0; p < parts; ++p) {
      const std::size_t first = p * part, end = p + 1 < parts ? first + part : size;
      teeth_below(&cumulative[first], end - first, sum, static_cast<double>(count), offset,
                  descendants_to + from + first);
      sum += sums[p];
    }
  }
  // Rounding can leave the last tooth above a sum of 0.9999999: it belongs to the last particle that weighs anything.
  std::size_t last = weight.size() - 1;
  while (last > 0 && !(weight[last] > 0)) --last;
  for (; last < weight.size(); ++last) descendants_to[last] = static_cast<std::int32_t>(count);
}

// value[i] = the largest of value[0 .. i]
HUETRACK_DEFAULT_VERSION void largest_so_far(std::uint32_t* value, std::size_t n) {
  std::uint32_t largest = 0;
  for (std::size_t i = 0; i < n; ++i) value[i] = largest = std::max(largest, value[i]);
}

#ifdef HUETRACK_AVX512_VERSION
HUETRACK_AVX512_VERSION void largest_so_far(std::uint32_t* value, std::size_t n) {
  const __m512i zero = _mm512_setzero_si512(), last = _mm512_set1_epi32(15);
  __m512i before = zero;
  std::size_t i = 0;
  for (; i + 16 <= n; i += 16) {
    __m512i v = _mm512_loadu_si512(value + i);
    v = _mm512_max_epu32(v, _mm512_alignr_epi32(v, zero, 15));
    v = _mm512_max_epu32(v, _mm512_alignr_epi32(v, zero, 14));
    v = _mm512_max_epu32(v, _mm512_alignr_epi32(v, zero, 12));
    v = _mm512_max_epu32(v, _mm512_alignr_epi32(v, zero, 8));
    v = _mm512_max_epu32(v, before);
    before = _mm512_permutexvar_epi32(last, v);
    _mm512_storeu_si512(value + i, v);
  }
  std::uint32_t largest = i > 0 ? value[i - 1] : 0;
  for (; i < n; ++i) value[i] = largest = std::max(largest, value[i]);
}
#endif

// Each particle writes itself where its descendants begin, and so do those before it that have none: the last one there
// is right. What lies between two such places is the nearer one to the left, the largest so far. No branch depends on
// how many descendants a particle has.
void name_ancestors(const std::int32_t* descendants_to, std::size_t n, std::span<std::uint32_t> ancestor) {
  std::ranges::fill(ancestor, 0u);
  std::size_t begin = 0;
  for (std::size_t i = 0; i < n && begin < ancestor.size(); ++i) {
    ancestor[begin] = static_cast<std::uint32_t>(i);
    begin = static_cast<std::size_t>(descendants_to[i]);
  }
  largest_so_far(ancestor.data(), ancestor.size());
}

// Each particle with descendants writes itself over all of them and up to spread_beyond further, where the next one
// writes afterwards. Those that have any come to the front first: nothing foretells which they are, so a branch would
// cost more. descendants_to: one more, with a 0 in front; parent: work space for one per particle.
HUETRACK_CLONES void spread(const std::int32_t* descendants_to, std::size_t n, std::int32_t* __restrict parent,
                            const std::array<const float*, 3>& in, const std::array<float*, 3>& out) {
  std::size_t parents = 0;
  for (std::size_t i = 0; i < n; ++i) {
    parent[parents] = static_cast<std::int32_t>(i);
    parents += descendants_to[i + 1] > descendants_to[i] ? 1 : 0;
  }
  const auto [in_x, in_y, in_z] = in;
  const auto [out_x, out_y, out_z] = out;
  constexpr std::size_t at_once = spread_beyond + 1;
  for (std::size_t k = 0; k < parents; ++k) {
    const auto i = static_cast<std::size_t>(parent[k]);
    const float x = in_x[i], y = in_y[i], z = in_z[i];
    const auto end = static_cast<std::size_t>(descendants_to[i + 1]);
    for (auto to = static_cast<std::size_t>(descendants_to[i]); to < end; to += at_once) {
      for (std::size_t j = 0; j < at_once; ++j) out_x[to + j] = x;
      for (std::size_t j = 0; j < at_once; ++j) out_y[to + j] = y;
      for (std::size_t j = 0; j < at_once; ++j) out_z[to + j] = z;
    }
  }
}

// Work space for so many numbers, without an allocation when they are few.
class Numbers {
 public:
  explicit Numbers(std::size_t n) {
    if (n > few_.size()) many_ = std::make_unique_for_overwrite<std::int32_t[]>(n);
  }
  std::int32_t* data() { return many_ ? many_.get() : few_.data(); }

 private:
  std::array<std::int32_t, 512> few_;
  std::unique_ptr<std::int32_t[]> many_;
};

}  // namespace

void systematic_ancestors(std::span<const float> weight, double offset, std::span<std::uint32_t> ancestor) {
  Numbers descendants_to(weight.size());
  systematic_descendants(weight, offset, ancestor.size(), descendants_to.data());
  name_ancestors(descendants_to.data(), weight.size(), ancestor);
}

void systematic_resample(std::span<const float> weight, double offset, std::size_t count,
                         const std::array<const float*, 3>& in, const std::array<float*, 3>& out) {
  Numbers descendants_to(weight.size() + 1), parent(weight.size());
  *descendants_to.data() = 0;
  systematic_descendants(weight, offset, count, descendants_to.data() + 1);
  spread(descendants_to.data(), weight.size(), parent.data(), in, out);
}

}  // namespace huetrack::particle_filter
