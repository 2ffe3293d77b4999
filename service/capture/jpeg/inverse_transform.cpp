#include "capture/jpeg/inverse_transform.h"

#include <algorithm>
#include <cstring>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace huetrack::capture {
namespace {

// Loeffler, Ligtenberg and Moschytz 1989, as in libjpeg: cosines with 13 fractional bits, two more bits between the
// passes. The rotations are multiplied out: each is a sum of two products of 16 bits.
constexpr int cosine_bits = 13, between_bits = 2;
constexpr int first_shift = cosine_bits - between_bits, second_shift = cosine_bits + between_bits + 3;
constexpr int fix_0_298 = 2446, fix_0_390 = 3196, fix_0_541 = 4433, fix_0_765 = 6270, fix_0_899 = 7373,
              fix_1_175 = 9633, fix_1_501 = 12299, fix_1_847 = 15137, fix_1_961 = 16069, fix_2_053 = 16819,
              fix_2_562 = 20995, fix_3_072 = 25172;

struct Rotation {  // x a + y b, x c + y d
  int a, b, c, d;
};
constexpr Rotation even{fix_0_541 + fix_0_765, fix_0_541, fix_0_541, fix_0_541 - fix_1_847};     // rows 2, 6
constexpr Rotation sums{fix_1_175 - fix_1_961, fix_1_175, fix_1_175, fix_1_175 - fix_0_390};     // 3 + 7, 1 + 5
constexpr Rotation outer{fix_0_298 - fix_0_899, -fix_0_899, -fix_0_899, fix_1_501 - fix_0_899};  // 7, 1
constexpr Rotation inner{fix_2_053 - fix_2_562, -fix_2_562, -fix_2_562, fix_3_072 - fix_2_562};  // 5, 3

std::int16_t wrapped(int value) {
  return static_cast<std::int16_t>(value);
}

// Eight values `step` apart, in place.
template <int shift>
void transform_eight(std::int16_t* values, std::ptrdiff_t step) {
  const auto in = [&](int i) -> int { return values[i * step]; };
  const auto product = [](int x, int a, int y, int b) { return static_cast<std::uint32_t>(x * a + y * b); };
  const std::uint32_t t3 = product(in(2), even.a, in(6), even.b), t2 = product(in(2), even.c, in(6), even.d);
  const auto t0 = static_cast<std::uint32_t>(wrapped(in(0) + in(4)) * (1 << cosine_bits));
  const auto t1 = static_cast<std::uint32_t>(wrapped(in(0) - in(4)) * (1 << cosine_bits));
  const int x = wrapped(in(3) + in(7)), y = wrapped(in(1) + in(5));
  const std::uint32_t z3 = product(x, sums.a, y, sums.b), z4 = product(x, sums.c, y, sums.d);
  const std::array<std::uint32_t, 4> odd{
      product(in(7), outer.c, in(1), outer.d) + z4, product(in(5), inner.c, in(3), inner.d) + z3,
      product(in(5), inner.a, in(3), inner.b) + z4, product(in(7), outer.a, in(1), outer.b) + z3};
  const std::array<std::uint32_t, 4> sum{t0 + t3, t1 + t2, t1 - t2, t0 - t3};
  const auto rounded = [](std::uint32_t value) {
    const std::int32_t shifted = static_cast<std::int32_t>(value + (1U << (shift - 1))) >> shift;
    return static_cast<std::int16_t>(std::clamp(shifted, -32768, 32767));
  };
  for (std::size_t i = 0; i < 4; ++i) {
    values[static_cast<std::ptrdiff_t>(i) * step] = rounded(sum[i] + odd[i]);
    values[static_cast<std::ptrdiff_t>(7 - i) * step] = rounded(sum[i] - odd[i]);
  }
}

#if defined(__SSE2__)

__m128i pairs(int a, int b) {
  return _mm_set1_epi32(static_cast<int>((static_cast<unsigned>(b) << 16) | (static_cast<unsigned>(a) & 0xFFFFU)));
}

struct Wide {  // eight sums of 32 bits
  __m128i low, high;
};
Wide operator+(const Wide& a, const Wide& b) {
  return {_mm_add_epi32(a.low, b.low), _mm_add_epi32(a.high, b.high)};
}
Wide operator-(const Wide& a, const Wide& b) {
  return {_mm_sub_epi32(a.low, b.low), _mm_sub_epi32(a.high, b.high)};
}

struct Rotated {
  Wide first, second;
};
Rotated rotated(__m128i x, __m128i y, const Rotation& r) {
  const __m128i low = _mm_unpacklo_epi16(x, y), high = _mm_unpackhi_epi16(x, y);
  const __m128i first = pairs(r.a, r.b), second = pairs(r.c, r.d);
  return {{_mm_madd_epi16(low, first), _mm_madd_epi16(high, first)},
          {_mm_madd_epi16(low, second), _mm_madd_epi16(high, second)}};
}

Wide scaled(__m128i x) {
  const __m128i zero = _mm_setzero_si128();
  return {_mm_srai_epi32(_mm_unpacklo_epi16(zero, x), 16 - cosine_bits),
          _mm_srai_epi32(_mm_unpackhi_epi16(zero, x), 16 - cosine_bits)};
}

template <int shift>
__m128i rounded_values(const Wide& w) {
  const __m128i half = _mm_set1_epi32(1 << (shift - 1));
  return _mm_packs_epi32(_mm_srai_epi32(_mm_add_epi32(w.low, half), shift),
                         _mm_srai_epi32(_mm_add_epi32(w.high, half), shift));
}

struct Rows {  // no std::array: GCC warns of the type's attributes
  __m128i row[8];
  __m128i& operator[](std::size_t i) { return row[i]; }
};

template <int shift>
[[gnu::always_inline]] inline void transform_columns(Rows& r) {
  const auto [t3, t2] = rotated(r[2], r[6], even);
  const Wide t0 = scaled(_mm_add_epi16(r[0], r[4])), t1 = scaled(_mm_sub_epi16(r[0], r[4]));
  const auto [z3, z4] = rotated(_mm_add_epi16(r[3], r[7]), _mm_add_epi16(r[1], r[5]), sums);
  const auto [o0, o3] = rotated(r[7], r[1], outer);
  const auto [o1, o2] = rotated(r[5], r[3], inner);
  const std::array<Wide, 4> odd{o3 + z4, o2 + z3, o1 + z4, o0 + z3}, sum{t0 + t3, t1 + t2, t1 - t2, t0 - t3};
  for (std::size_t i = 0; i < 4; ++i) {
    r[i] = rounded_values<shift>(sum[i] + odd[i]);
    r[7 - i] = rounded_values<shift>(sum[i] - odd[i]);
  }
}

[[gnu::always_inline]] inline void transpose(Rows& r) {
  Rows a, b;
  for (std::size_t i = 0; i < 4; ++i) {
    a[2 * i] = _mm_unpacklo_epi16(r[2 * i], r[2 * i + 1]);
    a[2 * i + 1] = _mm_unpackhi_epi16(r[2 * i], r[2 * i + 1]);
  }
  for (std::size_t i = 0; i < 2; ++i) {
    b[4 * i] = _mm_unpacklo_epi32(a[4 * i], a[4 * i + 2]);
    b[4 * i + 1] = _mm_unpackhi_epi32(a[4 * i], a[4 * i + 2]);
    b[4 * i + 2] = _mm_unpacklo_epi32(a[4 * i + 1], a[4 * i + 3]);
    b[4 * i + 3] = _mm_unpackhi_epi32(a[4 * i + 1], a[4 * i + 3]);
  }
  for (std::size_t i = 0; i < 4; ++i) {
    r[2 * i] = _mm_unpacklo_epi64(b[i], b[i + 4]);
    r[2 * i + 1] = _mm_unpackhi_epi64(b[i], b[i + 4]);
  }
}

#endif

}  // namespace

void plain_inverse_transform(const JpegBlock& block, bool is_first_row_only, std::uint8_t* pixels,
                             std::ptrdiff_t stride) {
  std::array<std::int16_t, 64> values = block.coefficients;
  for (std::ptrdiff_t u = 0; u < 8; ++u) {
    std::int16_t* column = values.data() + u;
    if (!is_first_row_only)
      transform_eight<first_shift>(column, 8);
    else
      for (int v = 7; v >= 0; --v) column[8 * v] = wrapped(column[0] * (1 << between_bits));
  }
  for (std::ptrdiff_t v = 0; v < 8; ++v) {
    std::int16_t* row = values.data() + 8 * v;
    transform_eight<second_shift>(row, 1);
    for (std::ptrdiff_t u = 0; u < 8; ++u)
      pixels[v * stride + u] = static_cast<std::uint8_t>(std::clamp<int>(row[u], -128, 127) + 128);
  }
}

#if defined(__SSE2__)
void inverse_transform(const JpegBlock& block, bool is_first_row_only, std::uint8_t* pixels, std::ptrdiff_t stride) {
  Rows r;
  for (std::size_t i = 0; i < 8; ++i)
    r[i] = _mm_load_si128(reinterpret_cast<const __m128i*>(block.coefficients.data() + 8 * i));
  if (is_first_row_only)
    for (std::size_t i = 8; i-- > 0;) r[i] = _mm_slli_epi16(r[0], between_bits);
  else
    transform_columns<first_shift>(r);
  transpose(r);
  transform_columns<second_shift>(r);
  transpose(r);
  for (std::size_t i = 0; i < 4; ++i) {
    const __m128i two = _mm_add_epi8(_mm_packs_epi16(r[2 * i], r[2 * i + 1]), _mm_set1_epi8(static_cast<char>(128)));
    std::uint8_t* row = pixels + static_cast<std::ptrdiff_t>(2 * i) * stride;
    _mm_storel_epi64(reinterpret_cast<__m128i*>(row), two);
    _mm_storel_epi64(reinterpret_cast<__m128i*>(row + stride), _mm_unpackhi_epi64(two, two));
  }
}
#else
void inverse_transform(const JpegBlock& block, bool is_first_row_only, std::uint8_t* pixels, std::ptrdiff_t stride) {
  plain_inverse_transform(block, is_first_row_only, pixels, stride);
}
#endif

}  // namespace huetrack::capture
