#include "capture/jpeg/inverse_transform.h"

#include <algorithm>

#if defined(__SSE2__)
#include <emmintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

#include "capture/jpeg/row_transform.h"

namespace huetrack::capture {
namespace {

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
#define HUETRACK_ROW_VECTORS
struct RowVectors {
  using Register = __m128i;
  static Register add16(Register a, Register b) { return _mm_add_epi16(a, b); }
  static Register sub16(Register a, Register b) { return _mm_sub_epi16(a, b); }
  static Register add32(Register a, Register b) { return _mm_add_epi32(a, b); }
  static Register sub32(Register a, Register b) { return _mm_sub_epi32(a, b); }
  static Register low16(Register a, Register b) { return _mm_unpacklo_epi16(a, b); }
  static Register high16(Register a, Register b) { return _mm_unpackhi_epi16(a, b); }
  static Register low32(Register a, Register b) { return _mm_unpacklo_epi32(a, b); }
  static Register high32(Register a, Register b) { return _mm_unpackhi_epi32(a, b); }
  static Register low64(Register a, Register b) { return _mm_unpacklo_epi64(a, b); }
  static Register high64(Register a, Register b) { return _mm_unpackhi_epi64(a, b); }
  static Register pack32(Register a, Register b) { return _mm_packs_epi32(a, b); }
  static Register all32(int a) { return _mm_set1_epi32(a); }
  static void products(Register x, Register y, int a, int b, Register& low, Register& high) {
    const Register both = all32(pair_of_16_bits(a, b));
    low = _mm_madd_epi16(low16(x, y), both);
    high = _mm_madd_epi16(high16(x, y), both);
  }
  template <int n>
  static Register shift32(Register a) {
    return _mm_srai_epi32(a, n);
  }
  template <int n>
  static Register shift16_up(Register a) {
    return _mm_slli_epi16(a, n);
  }
  static Register load(const std::int16_t* row) { return _mm_load_si128(reinterpret_cast<const __m128i*>(row)); }
  // Two rows of pixels, from numbers around 0.
  static void store(Register a, Register b, std::uint8_t* row, std::ptrdiff_t stride) {
    const Register two = _mm_add_epi8(_mm_packs_epi16(a, b), _mm_set1_epi8(static_cast<char>(128)));
    _mm_storel_epi64(reinterpret_cast<__m128i*>(row), two);
    _mm_storel_epi64(reinterpret_cast<__m128i*>(row + stride), _mm_unpackhi_epi64(two, two));
  }
};
#elif defined(__aarch64__)
#define HUETRACK_ROW_VECTORS
struct RowVectors {
  using Register = int16x8_t;
  static int32x4_t as32(Register a) { return vreinterpretq_s32_s16(a); }
  static int64x2_t as64(Register a) { return vreinterpretq_s64_s16(a); }
  static Register as16(int32x4_t a) { return vreinterpretq_s16_s32(a); }
  static Register as16(int64x2_t a) { return vreinterpretq_s16_s64(a); }
  static Register add16(Register a, Register b) { return vaddq_s16(a, b); }
  static Register sub16(Register a, Register b) { return vsubq_s16(a, b); }
  static Register add32(Register a, Register b) { return as16(vaddq_s32(as32(a), as32(b))); }
  static Register sub32(Register a, Register b) { return as16(vsubq_s32(as32(a), as32(b))); }
  static Register low16(Register a, Register b) { return vzip1q_s16(a, b); }
  static Register high16(Register a, Register b) { return vzip2q_s16(a, b); }
  static Register low32(Register a, Register b) { return as16(vzip1q_s32(as32(a), as32(b))); }
  static Register high32(Register a, Register b) { return as16(vzip2q_s32(as32(a), as32(b))); }
  static Register low64(Register a, Register b) { return as16(vzip1q_s64(as64(a), as64(b))); }
  static Register high64(Register a, Register b) { return as16(vzip2q_s64(as64(a), as64(b))); }
  static Register pack32(Register a, Register b) { return vqmovn_high_s32(vqmovn_s32(as32(a)), as32(b)); }
  static Register all32(int a) { return as16(vdupq_n_s32(a)); }
  static void products(Register x, Register y, int a, int b, Register& low, Register& high) {
    const auto by_a = static_cast<std::int16_t>(a), by_b = static_cast<std::int16_t>(b);
    low = as16(vmlal_n_s16(vmull_n_s16(vget_low_s16(x), by_a), vget_low_s16(y), by_b));
    high = as16(vmlal_high_n_s16(vmull_high_n_s16(x, by_a), y, by_b));
  }
  template <int n>
  static Register shift32(Register a) {
    return as16(vshrq_n_s32(as32(a), n));
  }
  template <int n>
  static Register shift16_up(Register a) {
    return vshlq_n_s16(a, n);
  }
  static Register load(const std::int16_t* row) { return vld1q_s16(row); }
  static void store(Register a, Register b, std::uint8_t* row, std::ptrdiff_t stride) {
    const uint8x8_t middle = vdup_n_u8(128);
    vst1_u8(row, vadd_u8(vreinterpret_u8_s8(vqmovn_s16(a)), middle));
    vst1_u8(row + stride, vadd_u8(vreinterpret_u8_s8(vqmovn_s16(b)), middle));
  }
};
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

#if defined(HUETRACK_ROW_VECTORS)
void inverse_transform(const JpegBlock& block, bool is_first_row_only, std::uint8_t* pixels, std::ptrdiff_t stride) {
  using Transform = RowTransform<RowVectors>;
  Transform::Rows rows;
  for (std::size_t i = 0; i < 8; ++i) rows.row[i] = RowVectors::load(block.coefficients.data() + 8 * i);
  if (is_first_row_only) {
    const auto scaled = RowVectors::shift16_up<between_bits>(rows.row[0]);
    for (auto& row : rows.row) row = scaled;
    Transform::second_pass(rows);
  } else {
    Transform::both_passes(rows);
  }
  for (std::size_t i = 0; i < 8; i += 2)
    RowVectors::store(rows.row[i], rows.row[i + 1], pixels + static_cast<std::ptrdiff_t>(i) * stride, stride);
}
#else
void inverse_transform(const JpegBlock& block, bool is_first_row_only, std::uint8_t* pixels, std::ptrdiff_t stride) {
  plain_inverse_transform(block, is_first_row_only, pixels, stride);
}
#endif

void inverse_transform_two(const std::array<JpegBlock, 2>& blocks, const std::array<BlockPixels, 2>& to) {
  if (avx2_inverse_transform_two(blocks, to)) return;
  for (std::size_t i = 0; i < 2; ++i) inverse_transform(blocks[i], false, to[i].pixels, to[i].stride);
}

}  // namespace huetrack::capture
