#include "capture/jpeg/inverse_transform.h"
#include "particle_filter/vector_clones.h"

#if defined(HUETRACK_AVX2_VERSION)

#include <immintrin.h>

// All that follows, templates included. It is called where the processor has AVX2 only.
#ifdef __clang__
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC target("avx2")
#endif
#include "capture/jpeg/row_transform.h"

namespace huetrack::capture {
namespace {

struct Avx2 {  // a lane for each of two blocks
  using Register = __m256i;
  static Register add16(Register a, Register b) { return _mm256_add_epi16(a, b); }
  static Register sub16(Register a, Register b) { return _mm256_sub_epi16(a, b); }
  static Register add32(Register a, Register b) { return _mm256_add_epi32(a, b); }
  static Register sub32(Register a, Register b) { return _mm256_sub_epi32(a, b); }
  static Register low16(Register a, Register b) { return _mm256_unpacklo_epi16(a, b); }
  static Register high16(Register a, Register b) { return _mm256_unpackhi_epi16(a, b); }
  static Register low32(Register a, Register b) { return _mm256_unpacklo_epi32(a, b); }
  static Register high32(Register a, Register b) { return _mm256_unpackhi_epi32(a, b); }
  static Register low64(Register a, Register b) { return _mm256_unpacklo_epi64(a, b); }
  static Register high64(Register a, Register b) { return _mm256_unpackhi_epi64(a, b); }
  static Register pack32(Register a, Register b) { return _mm256_packs_epi32(a, b); }
  static Register all32(int a) { return _mm256_set1_epi32(a); }
  static void products(Register x, Register y, int a, int b, Register& low, Register& high) {
    const Register both = all32(pair_of_16_bits(a, b));
    low = _mm256_madd_epi16(low16(x, y), both);
    high = _mm256_madd_epi16(high16(x, y), both);
  }
  template <int n>
  static Register shift32(Register a) {
    return _mm256_srai_epi32(a, n);
  }
};

void transform_two(const std::array<JpegBlock, 2>& blocks, const std::array<BlockPixels, 2>& to) {
  using Transform = RowTransform<Avx2>;
  Transform::Rows rows;
  for (std::size_t i = 0; i < 8; ++i) {
    const auto row = [&](std::size_t block) {
      return _mm_load_si128(reinterpret_cast<const __m128i*>(blocks[block].coefficients.data() + 8 * i));
    };
    rows.row[i] = _mm256_set_m128i(row(1), row(0));
  }
  Transform::both_passes(rows);
  for (std::size_t i = 0; i < 8; i += 2) {
    const __m256i all =
        _mm256_add_epi8(_mm256_packs_epi16(rows.row[i], rows.row[i + 1]), _mm256_set1_epi8(static_cast<char>(128)));
    for (std::size_t block = 0; block < 2; ++block) {
      std::uint8_t* row = to[block].pixels + static_cast<std::ptrdiff_t>(i) * to[block].stride;
      const __m128i both = block == 0 ? _mm256_castsi256_si128(all) : _mm256_extracti128_si256(all, 1);
      _mm_storel_epi64(reinterpret_cast<__m128i*>(row), both);
      _mm_storel_epi64(reinterpret_cast<__m128i*>(row + to[block].stride), _mm_unpackhi_epi64(both, both));
    }
  }
}

}  // namespace

bool avx2_inverse_transform_two(const std::array<JpegBlock, 2>& blocks, const std::array<BlockPixels, 2>& to) {
  static const bool has_avx2 = __builtin_cpu_supports("avx2");
  if (has_avx2) transform_two(blocks, to);
  return has_avx2;
}

}  // namespace huetrack::capture

#ifdef __clang__
#pragma clang attribute pop
#endif

#else

namespace huetrack::capture {
bool avx2_inverse_transform_two(const std::array<JpegBlock, 2>&, const std::array<BlockPixels, 2>&) {
  return false;
}
}  // namespace huetrack::capture

#endif
