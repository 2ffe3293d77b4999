#include "color/window_kernels.h"

#if defined(__x86_64__) && !defined(HUETRACK_NO_AVX512)

#include <immintrin.h>

#include <cstring>

#define HUETRACK_AVX512 __attribute__((target("avx512f,avx512bw,avx512dq,avx512vl,avx512vbmi,avx512vpopcntdq,bmi2")))

namespace huetrack::color {
namespace {

template <typename Word>
Word load(const std::uint8_t* p) {
  Word word;
  std::memcpy(&word, p, sizeof word);
  return word;
}

// Four rows of eight pixels as a camera with 4:2:2 sampling packs them: the bytes Y0 U Y1 V of each pair of neighbours.
template <capture::PixelFormat format>
HUETRACK_AVX512 inline __m512i four_rows(const capture::Image& image, int u, int v) {
  const auto row = [&image](int plane, int r) {
    const capture::Plane& p = image.planes[static_cast<std::size_t>(plane)];
    return p.data + r * p.stride;
  };
  if constexpr (format == capture::PixelFormat::yuyv) {
    const auto pairs = [&](int r) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(row(0, v + r) + 2 * u)); };
    return _mm512_inserti64x4(_mm512_castsi256_si512(_mm256_set_m128i(pairs(1), pairs(0))),
                              _mm256_set_m128i(pairs(3), pairs(2)), 1);
  } else {
    const auto chroma_row = [&](int r) { return format == capture::PixelFormat::i422 ? v + r : (v + r) / 2; };
    const auto luma = [&](int r) { return load<long long>(row(0, v + r) + u); };
    const __m256i y = _mm256_set_epi64x(luma(3), luma(2), luma(1), luma(0));
    __m256i uv;
    if constexpr (format == capture::PixelFormat::nv12) {
      const auto pairs = [&](int r) { return load<long long>(row(1, chroma_row(r)) + u); };
      uv = _mm256_set_epi64x(pairs(2), pairs(2), pairs(0), pairs(0));
    } else {
      const auto chroma = [&](int plane) {
        const auto four = [&](int r) { return load<int>(row(plane, chroma_row(r)) + u / 2); };
        return _mm_set_epi32(four(3), four(2), four(1), four(0));
      };
      const __m128i cu = chroma(1), cv = chroma(2);
      uv = _mm256_set_m128i(_mm_unpackhi_epi8(cu, cv), _mm_unpacklo_epi8(cu, cv));
    }
    return _mm512_or_si512(_mm512_cvtepu8_epi16(y), _mm512_slli_epi16(_mm512_cvtepu8_epi16(uv), 8));
  }
}

// Sixteen look-ups give the intervals of y of 32 pixels, two comparisons their bits.
HUETRACK_AVX512 inline std::uint64_t classify_four_rows(const ColorTable::Interval* intervals, __m512i pairs) {
  static_assert(sizeof(ColorTable::Interval) == 2);  // y_min in the low byte, y_max in the high one
  const __m512i uv = _mm512_or_si512(_mm512_and_si512(_mm512_srli_epi32(pairs, 8), _mm512_set1_epi32(0xff)),
                                     _mm512_and_si512(_mm512_srli_epi32(pairs, 16), _mm512_set1_epi32(0xff00)));
  const __m512i interval = _mm512_i32gather_epi32(uv, intervals, 2);
  const __m512i low = _mm512_shuffle_epi8(
      interval, _mm512_broadcast_i32x4(_mm_setr_epi8(0, -1, 0, -1, 4, -1, 4, -1, 8, -1, 8, -1, 12, -1, 12, -1)));
  const __m512i high = _mm512_shuffle_epi8(
      interval, _mm512_broadcast_i32x4(_mm_setr_epi8(1, -1, 1, -1, 5, -1, 5, -1, 9, -1, 9, -1, 13, -1, 13, -1)));
  const __mmask64 match = _mm512_cmpge_epu8_mask(pairs, low) & _mm512_cmple_epu8_mask(pairs, high);
  return _pext_u64(match, 0x5555555555555555u);  // the luma bytes
}

// Is any of 32 pixels dark enough for its chroma (ColorTable::LumaCeiling)? of_u, of_v: the ceilings.
HUETRACK_AVX512 inline bool any_below_ceiling(__m512i of_u, __m512i of_v, __m512i pairs) {
  const __m512i quarters = _mm512_srli_epi16(pairs, 2);  // the look-up takes the low six bits of each byte
  const __m512i of_us = _mm512_permutexvar_epi8(quarters, of_u), of_vs = _mm512_permutexvar_epi8(quarters, of_v);
  const __m512i ceiling = _mm512_min_epu8(
      _mm512_shuffle_epi8(
          of_us, _mm512_broadcast_i32x4(_mm_setr_epi8(1, -1, 1, -1, 5, -1, 5, -1, 9, -1, 9, -1, 13, -1, 13, -1))),
      _mm512_shuffle_epi8(
          of_vs, _mm512_broadcast_i32x4(_mm_setr_epi8(3, -1, 3, -1, 7, -1, 7, -1, 11, -1, 11, -1, 15, -1, 15, -1))));
  return _mm512_mask_cmple_epu8_mask(0x5555555555555555u, pairs, ceiling) != 0;
}

// Most tiles are background, and most of that is too bright for a colour: it needs no look-up in the table.
template <capture::PixelFormat format>
HUETRACK_AVX512 void classify_as(const capture::Image& image, const ColorTable& table, const TileAt* tiles,
                                 std::size_t n, std::uint64_t* bits) {
  const ColorTable::Interval* const intervals = table.intervals();
  const __m512i of_u = _mm512_loadu_si512(table.luma_ceiling().of_u.data()),
                of_v = _mm512_loadu_si512(table.luma_ceiling().of_v.data());
  for (std::size_t i = 0; i < n; ++i) {
    const int u = tiles[i].pixel_u(), v = tiles[i].pixel_v();
    const __m512i upper = four_rows<format>(image, u, v), lower = four_rows<format>(image, u, v + 4);
    if (int{any_below_ceiling(of_u, of_v, upper)} | int{any_below_ceiling(of_u, of_v, lower)}) {
      bits[i] = classify_four_rows(intervals, upper) | classify_four_rows(intervals, lower) << 32;
    } else {
      bits[i] = 0;
    }
  }
}

HUETRACK_AVX512 inline __m256i cell_and_left(const std::uint8_t* p) {
  return _mm256_or_si256(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)),
                         _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p - 1)));
}

// Sixteen tiles at a time: a lane of 16 bits has two cells.
HUETRACK_AVX512 std::size_t touched(const std::uint8_t* marked, std::ptrdiff_t cell_stride, std::uint32_t* known,
                                    std::uint32_t frame, int first, int count, int tile_v, TileAt* tiles) {
  static_assert(sizeof(TileAt) == 4);
  const __m512i now = _mm512_set1_epi32(static_cast<int>(frame));
  const __m512i steps = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  std::size_t n = 0;
  for (int u = first; u < first + count; u += 16) {
    const std::uint8_t* const p = marked + 2 * u;
    const __m256i any = _mm256_or_si256(_mm256_or_si256(cell_and_left(p), cell_and_left(p - cell_stride)),
                                        cell_and_left(p + cell_stride));
    const auto some = static_cast<__mmask16>(first + count - u >= 16 ? 0xffff : (1u << (first + count - u)) - 1);
    const __mmask16 hit = _mm256_mask_test_epi16_mask(some, any, any);
    const __mmask16 unknown = _mm512_mask_cmpneq_epi32_mask(hit, _mm512_loadu_si512(known + u), now);
    _mm512_mask_storeu_epi32(known + u, unknown, now);
    const __m512i at = _mm512_add_epi32(_mm512_set1_epi32(u | tile_v << 16), steps);
    _mm512_storeu_si512(tiles + n, _mm512_maskz_compress_epi32(unknown, at));
    n += static_cast<std::size_t>(__builtin_popcount(unknown));
  }
  return n;
}

void classify(const capture::Image& image, const ColorTable& table, const TileAt* tiles, std::size_t n,
              std::uint64_t* bits) {
  for_chroma_of(
      image.format, [&]<capture::PixelFormat format>() { classify_as<format>(image, table, tiles, n, bits); },
      [&] { portable_window_kernels().classify(image, table, tiles, n, bits); });
}

HUETRACK_AVX512 void count(const std::uint8_t* bands, const std::int32_t* byte, const std::int32_t* shift,
                           std::size_t n, std::uint8_t* k) {
  for (std::size_t i = 0; i < n; i += 8) {
    const auto some = static_cast<__mmask8>(n - i >= 8 ? 0xff : (1u << (n - i)) - 1);
    const __m256i where = _mm256_maskz_loadu_epi32(some, byte + i), by = _mm256_maskz_loadu_epi32(some, shift + i);
    const __m512i rows = _mm512_i32gather_epi64(where, bands, 1);
    const __m512i window =
        _mm512_and_si512(_mm512_srlv_epi64(rows, _mm512_cvtepu32_epi64(_mm256_and_si256(by, _mm256_set1_epi32(3)))),
                         _mm512_set1_epi64(0x1f1f1f1f1f));
    const __m128i counted = _mm512_cvtepi64_epi8(_mm512_popcnt_epi64(window));
    _mm_mask_storeu_epi8(k + i, some, _mm_or_si128(counted, _mm256_cvtepi32_epi8(_mm256_srli_epi32(by, 8))));
  }
}

}  // namespace

const WindowKernels* avx512_window_kernels() {
  static const WindowKernels kernels{touched, classify, count};
  static const bool has_it = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                             __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
                             __builtin_cpu_supports("avx512vbmi") && __builtin_cpu_supports("avx512vpopcntdq") &&
                             __builtin_cpu_supports("bmi2");
  return has_it ? &kernels : nullptr;
}

}  // namespace huetrack::color

#else

namespace huetrack::color {
const WindowKernels* avx512_window_kernels() {
  return nullptr;
}
}  // namespace huetrack::color

#endif
