#include "particle_filter/random.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "particle_filter/vector_clones.h"

namespace huetrack::particle_filter {
namespace {

std::uint64_t splitmix64(std::uint64_t& x) {
  std::uint64_t z = (x += 0x9e3779b97f4a7c15u);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

// 2 x 16 random words to 2 x 16 normals. Box-Muller with polynomials instead of libm, because only those vectorise:
// worth a factor of 8 (tests/benchmark: fill_normal). Errors: log 1e-7 relative, sine 3e-7 absolute.
HUETRACK_CLONES void box_muller(const std::uint32_t* __restrict a, const std::uint32_t* __restrict b,
                                float* __restrict out, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) {
    // u in (0, 1], 24 bits; here 2^24 u. log(u): u = m 2^e with m in [sqrt(1/2), sqrt(2)), atanh series in
    // s = (m - 1) / (m + 1).
    constexpr std::int32_t root_half = 0x3f3504f3, mantissa = 0x007fffff, one = mantissa + 1;  // one: of the exponent
    const auto scaled_u = static_cast<float>(static_cast<std::int32_t>(a[i] >> 8) + 1);
    const std::int32_t bits = std::bit_cast<std::int32_t>(scaled_u) - (root_half + 24 * one);
    const std::int32_t e = bits >> 23;
    const float m = std::bit_cast<float>((bits & mantissa) + root_half);
    const float s = (m - 1.0f) / (m + 1.0f);
    const float s2 = s * s;
    const float minus_2_log_u =
        static_cast<float>(e) * (-2 * 0.69314718056f) +
        -4.0f * s * (1.0f + s2 * (0.333333333f + s2 * (0.2f + s2 * (0.142857143f + s2 * 0.111111111f))));
    const float radius = std::sqrt(minus_2_log_u);
    // angle = 2 pi t, t in [-1/2, 1/2); here 2^24 t. sin(2 pi t): fold t to [-1/4, 1/4], then a Taylor polynomial.
    const auto t = static_cast<float>(static_cast<std::int32_t>(b[i]) >> 8);
    const float q = std::abs(t);
    const float fold_sin = q > 0x1p22f ? 0x1p23f - q : q;  // |sin|
    const float fold_cos = 0x1p22f - q;                    // cos(2 pi t) = sin(2 pi (1/4 - |t|))
    const auto sine = [](float turns) {
      const float x = turns * (0x1p-24f * 6.28318530718f);
      const float x2 = x * x;
      return x *
             (1.0f + x2 * (-1.66666667e-1f +
                           x2 * (8.33333333e-3f + x2 * (-1.98412698e-4f + x2 * (2.75573192e-6f - x2 * 2.50521e-8f)))));
    };
    const float sin_t = std::copysign(sine(fold_sin), t);
    out[i] = radius * sine(fold_cos);
    out[n + i] = radius * sin_t;
  }
}

}  // namespace

Rng::Rng(std::uint64_t seed, std::uint64_t stream) {
  std::uint64_t x = seed;
  std::uint64_t mixed = splitmix64(x) ^ (stream * 0xd1342543de82ef95u + 0x632be59bd9b4e019u);
  for (Block& word : state_) {
    for (std::uint32_t& lane : word) lane = static_cast<std::uint32_t>(splitmix64(mixed) >> 32);
  }
}

namespace {

// The generators' words as vectors of the machine's width, so that the state of those that step together stays in
// registers: a vector wider than the machine's goes through memory at every step, which took two thirds of the time.
template <int bytes>
struct Lanes {
  using Words [[gnu::vector_size(bytes)]] = std::uint32_t;
};

// The state of some of the generators, beginning with the one at `first`.
template <typename Words, std::size_t together>
[[gnu::always_inline]] inline void advance_some(std::array<std::array<std::uint32_t, 16>, 4>& state, std::size_t first,
                                                std::size_t count, std::uint32_t* __restrict a,
                                                std::uint32_t* __restrict b) {
  constexpr std::size_t lanes = sizeof(Words) / sizeof(std::uint32_t);
  Words s[4][together];
  for (std::size_t word = 0; word < 4; ++word) std::memcpy(s[word], &state[word][first], sizeof s[word]);
  for (std::size_t i = 0; i < count; ++i) {
    std::uint32_t* to = (i % 2 == 0 ? a : b) + i / 2 * 16 + first;
#pragma GCC unroll 2
    for (std::size_t k = 0; k < together; ++k) {
      const Words sum = s[0][k] + s[3][k];
      const Words out = (sum << 7 | sum >> 25) + s[0][k];
      const Words t = s[1][k] << 9;
      s[2][k] ^= s[0][k];
      s[3][k] ^= s[1][k];
      s[1][k] ^= s[2][k];
      s[0][k] ^= s[3][k];
      s[2][k] ^= t;
      s[3][k] = s[3][k] << 11 | s[3][k] >> 21;
      std::memcpy(to + k * lanes, &out, sizeof out);
    }
  }
  for (std::size_t word = 0; word < 4; ++word) std::memcpy(&state[word][first], s[word], sizeof s[word]);
}

// count blocks of one word per generator, in turn to a and to b (a first), which are count / 2 blocks long.
HUETRACK_DEFAULT_VERSION void advance(std::array<std::array<std::uint32_t, 16>, 4>& state, std::size_t count,
                                      std::uint32_t* __restrict a, std::uint32_t* __restrict b) {
  for (const std::size_t first : {0, 8}) advance_some<Lanes<16>::Words, 2>(state, first, count, a, b);
}

#ifdef HUETRACK_AVX2_VERSION
HUETRACK_AVX2_VERSION void advance(std::array<std::array<std::uint32_t, 16>, 4>& state, std::size_t count,
                                   std::uint32_t* __restrict a, std::uint32_t* __restrict b) {
  advance_some<Lanes<32>::Words, 2>(state, 0, count, a, b);
}
#endif

#ifdef HUETRACK_AVX512_VERSION
HUETRACK_AVX512_VERSION void advance(std::array<std::array<std::uint32_t, 16>, 4>& state, std::size_t count,
                                     std::uint32_t* __restrict a, std::uint32_t* __restrict b) {
  advance_some<Lanes<64>::Words, 1>(state, 0, count, a, b);
}
#endif

}  // namespace

void Rng::advance(Block& out) {
  particle_filter::advance(state_, 1, out.data(), nullptr);
}

double Rng::uniform() {
  Block block;
  advance(block);
  return (static_cast<double>(block[0] >> 6) * 0x1p26 + static_cast<double>(block[1] >> 6)) * 0x1p-52;
}

void Rng::fill_uniform(std::span<float> out) {
  Block block;
  for (std::size_t i = 0; i < out.size(); i += lanes) {
    advance(block);
    for (std::size_t j = 0; j < std::min(lanes, out.size() - i); ++j) {
      out[i + j] = static_cast<float>(block[j] >> 8) * 0x1p-24f;
    }
  }
}

void Rng::fill_normal(std::span<float> out) {
  constexpr std::size_t batch = 8 * lanes;  // words of each kind, twice as many normals
  std::array<std::uint32_t, batch> a;
  std::array<std::uint32_t, batch> b;
  std::array<float, 2 * batch> z;
  for (std::size_t i = 0; i < out.size(); i += 2 * batch) {
    const std::size_t wanted = std::min(2 * batch, out.size() - i);
    const std::size_t words = (wanted + 2 * lanes - 1) / (2 * lanes) * lanes;
    particle_filter::advance(state_, 2 * words / lanes, a.data(), b.data());
    box_muller(a.data(), b.data(), wanted == 2 * words ? out.data() + i : z.data(), words);
    if (wanted != 2 * words) std::copy_n(z.begin(), wanted, out.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

}  // namespace huetrack::particle_filter
