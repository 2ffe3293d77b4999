#include "color/window_kernels.h"

#include <bit>
#include <cstring>
#include <utility>

#include "particle_filter/vector_clones.h"

#if defined(HUETRACK_AVX2_VERSION)
#include <immintrin.h>
#elif defined(__SSE2__)
#include <emmintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#endif

namespace huetrack::color {
namespace {

std::uint64_t classify_pixel_by_pixel(const capture::Image& image, const ColorTable& table, int u, int v) {
  std::uint64_t bits = 0;
  for (int i = 0; i < 64; ++i) bits |= static_cast<std::uint64_t>(has_color(image, table, u + i % 8, v + i / 8)) << i;
  return bits;
}

// Sixteen bytes: luma, or u and v, of two rows of eight pixels whose neighbours share a chroma sample. Of each machine:
//   halves          eight bytes from here and eight from there
//   four_pairs      u and v of a row, which lie apart, side by side; of two rows
//   split           luma from chroma of two rows in which they lie side by side
//   of_two_rows     which of the pixels match. y: row after row; uv: the index u | v << 8 of each pair. Eight look-ups
//                   give the intervals of y; sixteen comparisons at once give the bits
#if defined(__SSE2__)
using Bytes = __m128i;
struct TwoRows {
  Bytes y, uv;
};

std::uint32_t of_two_rows(const ColorTable::Interval* intervals, const TwoRows& rows) {
  const auto [y, uv] = rows;
  static_assert(sizeof(ColorTable::Interval) == 2);
  const auto interval = [&](int index) {
    std::uint16_t bytes;  // y_min in the low byte, y_max in the high one
    std::memcpy(&bytes, intervals + index, 2);
    return bytes;
  };
  __m128i i = _mm_cvtsi32_si128(interval(_mm_extract_epi16(uv, 0)));
  i = _mm_insert_epi16(i, interval(_mm_extract_epi16(uv, 1)), 1);
  i = _mm_insert_epi16(i, interval(_mm_extract_epi16(uv, 2)), 2);
  i = _mm_insert_epi16(i, interval(_mm_extract_epi16(uv, 3)), 3);
  i = _mm_insert_epi16(i, interval(_mm_extract_epi16(uv, 4)), 4);
  i = _mm_insert_epi16(i, interval(_mm_extract_epi16(uv, 5)), 5);
  i = _mm_insert_epi16(i, interval(_mm_extract_epi16(uv, 6)), 6);
  i = _mm_insert_epi16(i, interval(_mm_extract_epi16(uv, 7)), 7);
  const __m128i low = _mm_or_si128(_mm_and_si128(i, _mm_set1_epi16(0xff)), _mm_slli_epi16(i, 8));
  const __m128i high = _mm_or_si128(_mm_srli_epi16(i, 8), _mm_andnot_si128(_mm_set1_epi16(0xff), i));
  const __m128i match =
      _mm_and_si128(_mm_cmpeq_epi8(_mm_max_epu8(y, low), y), _mm_cmpeq_epi8(_mm_min_epu8(y, high), y));
  return static_cast<std::uint32_t>(_mm_movemask_epi8(match));
}

Bytes halves(const std::uint8_t* low, const std::uint8_t* high) {
  return _mm_unpacklo_epi64(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(low)),
                            _mm_loadl_epi64(reinterpret_cast<const __m128i*>(high)));
}

__m128i four_bytes(const std::uint8_t* p) {
  std::int32_t bytes;
  std::memcpy(&bytes, p, 4);
  return _mm_cvtsi32_si128(bytes);
}

Bytes four_pairs(const std::uint8_t* u_low, const std::uint8_t* v_low, const std::uint8_t* u_high,
                 const std::uint8_t* v_high) {
  return _mm_unpacklo_epi64(_mm_unpacklo_epi8(four_bytes(u_low), four_bytes(v_low)),
                            _mm_unpacklo_epi8(four_bytes(u_high), four_bytes(v_high)));
}

TwoRows split(const std::uint8_t* low, const std::uint8_t* high) {
  const __m128i a = _mm_loadu_si128(reinterpret_cast<const __m128i*>(low));
  const __m128i b = _mm_loadu_si128(reinterpret_cast<const __m128i*>(high));
  const __m128i even = _mm_set1_epi16(0xff);
  return {_mm_packus_epi16(_mm_and_si128(a, even), _mm_and_si128(b, even)),
          _mm_packus_epi16(_mm_srli_epi16(a, 8), _mm_srli_epi16(b, 8))};
}
#elif defined(__ARM_NEON) && defined(__aarch64__)
using Bytes = uint8x16_t;
struct TwoRows {
  Bytes y, uv;
};

std::uint32_t of_two_rows(const ColorTable::Interval* intervals, const TwoRows& rows) {
  const auto [y, uv] = rows;
  static_assert(sizeof(ColorTable::Interval) == 2 && std::endian::native == std::endian::little);
  std::uint16_t index[8], found[8];  // y_min in the low byte, y_max in the high one
  vst1q_u16(index, vreinterpretq_u16_u8(uv));
  for (int i = 0; i < 8; ++i) std::memcpy(found + i, intervals + index[i], 2);
  const uint16x8_t pairs = vld1q_u16(found);
  const uint8x8_t y_min = vmovn_u16(pairs), y_max = vshrn_n_u16(pairs, 8);
  const uint8x16_t low = vcombine_u8(vzip1_u8(y_min, y_min), vzip2_u8(y_min, y_min));
  const uint8x16_t high = vcombine_u8(vzip1_u8(y_max, y_max), vzip2_u8(y_max, y_max));
  constexpr std::uint8_t places[16] = {1, 2, 4, 8, 16, 32, 64, 128, 1, 2, 4, 8, 16, 32, 64, 128};
  const uint8x16_t bits = vandq_u8(vandq_u8(vcgeq_u8(y, low), vcleq_u8(y, high)), vld1q_u8(places));
  return static_cast<std::uint32_t>(vaddv_u8(vget_low_u8(bits)) | vaddv_u8(vget_high_u8(bits)) << 8);
}

Bytes halves(const std::uint8_t* low, const std::uint8_t* high) {
  return vcombine_u8(vld1_u8(low), vld1_u8(high));
}

uint8x8_t four_bytes(const std::uint8_t* p) {
  std::uint32_t bytes;
  std::memcpy(&bytes, p, 4);
  return vcreate_u8(bytes);
}

Bytes four_pairs(const std::uint8_t* u_low, const std::uint8_t* v_low, const std::uint8_t* u_high,
                 const std::uint8_t* v_high) {
  return vcombine_u8(vzip1_u8(four_bytes(u_low), four_bytes(v_low)), vzip1_u8(four_bytes(u_high), four_bytes(v_high)));
}

TwoRows split(const std::uint8_t* low, const std::uint8_t* high) {
  const uint8x8x2_t a = vld2_u8(low), b = vld2_u8(high);
  return {vcombine_u8(a.val[0], b.val[0]), vcombine_u8(a.val[1], b.val[1])};
}
#endif

#if defined(__SSE2__) || (defined(__ARM_NEON) && defined(__aarch64__))
// Rows v and v + 1 of eight pixels from u on.
template <capture::PixelFormat format>
inline TwoRows two_rows(const capture::Image& image, int u, int v) {
  const auto row = [&image](int plane, int r) {
    const capture::Plane& p = image.planes[static_cast<std::size_t>(plane)];
    return p.data + r * p.stride;
  };
  if constexpr (format == capture::PixelFormat::yuyv) {  // Y0 U Y1 V
    return split(row(0, v) + 2 * u, row(0, v + 1) + 2 * u);
  } else {
    const int first = format == capture::PixelFormat::i422 ? v : v / 2;
    const int second = format == capture::PixelFormat::i422 ? v + 1 : first;
    return {halves(row(0, v) + u, row(0, v + 1) + u), format == capture::PixelFormat::nv12
                                                          ? halves(row(1, first) + u, row(1, second) + u)
                                                          : four_pairs(row(1, first) + u / 2, row(2, first) + u / 2,
                                                                       row(1, second) + u / 2, row(2, second) + u / 2)};
  }
}

template <capture::PixelFormat format>
std::uint64_t classify_tile(const capture::Image& image, const ColorTable& table, int u, int v) {
  std::uint64_t bits = 0;
  for (int r = 0; r < 8; r += 2) {
    const std::uint64_t found = of_two_rows(table.intervals(), two_rows<format>(image, u, v + r));
    bits |= found << (8 * r);
  }
  return bits;
}
#else
template <capture::PixelFormat>
std::uint64_t classify_tile(const capture::Image& image, const ColorTable& table, int u, int v) {
  return classify_pixel_by_pixel(image, table, u, v);
}
#endif

template <typename Tile>
void classify_all(const Tile& tile, const capture::Image& image, const ColorTable& table, const TileAt* tiles,
                  std::size_t n, std::uint64_t* bits) {
  for (std::size_t i = 0; i < n; ++i) bits[i] = tile(image, table, tiles[i].pixel_u(), tiles[i].pixel_v());
}

void classify(const capture::Image& image, const ColorTable& table, const TileAt* tiles, std::size_t n,
              std::uint64_t* bits) {
  for_chroma_of(
      image.format,
      [&]<capture::PixelFormat format>() { classify_all(classify_tile<format>, image, table, tiles, n, bits); },
      [&] { classify_all(classify_pixel_by_pixel, image, table, tiles, n, bits); });
}

std::size_t touched(const std::uint8_t* marked, std::ptrdiff_t cell_stride, std::uint32_t* known, std::uint32_t frame,
                    int first, int count, int tile_v, TileAt* tiles) {
  std::size_t n = 0;
  for (int u = first; u < first + count; ++u) {
    const std::uint8_t* const cell = marked + 2 * u;
    unsigned any = 0;
    for (int c = -1; c <= 1; ++c) any |= unsigned{cell[c - cell_stride]} | cell[c] | cell[c + cell_stride];
    if (any == 0 || std::exchange(known[u], frame) == frame) continue;
    tiles[n++] = {static_cast<std::uint16_t>(u), static_cast<std::uint16_t>(tile_v)};
  }
  return n;
}

HUETRACK_CLONES void count(const std::uint8_t* __restrict bands, const std::int32_t* __restrict byte,
                           const std::int32_t* __restrict shift, std::size_t n, std::uint8_t* __restrict k) {
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint64_t window = load_word(bands + byte[i]) >> (shift[i] & 3) & 0x1f1f1f1f1fu;
    k[i] = static_cast<std::uint8_t>(std::popcount(window) | shift[i] >> 8);
  }
}

#ifdef HUETRACK_AVX2_VERSION
// 64 bytes that are looked up by six bits.
struct SixBitTable {
  __m256i quarter[4];
};

HUETRACK_AVX2_VERSION inline SixBitTable six_bit_table(const std::uint8_t* values) {
  SixBitTable out;
  for (int i = 0; i < 4; ++i)
    out.quarter[i] = _mm256_broadcastsi128_si256(_mm_loadu_si128(reinterpret_cast<const __m128i*>(values + 16 * i)));
  return out;
}

// Of the upper six bits of each byte.
HUETRACK_AVX2_VERSION inline __m256i looked_up(const SixBitTable& table, __m256i bytes) {
  const __m256i index = _mm256_and_si256(_mm256_srli_epi16(bytes, 2), _mm256_set1_epi8(0x3f));
  const __m256i by_bit_4 = _mm256_slli_epi16(index, 3), by_bit_5 = _mm256_slli_epi16(index, 2);  // a blend's top bit
  return _mm256_blendv_epi8(_mm256_blendv_epi8(_mm256_shuffle_epi8(table.quarter[0], index),
                                               _mm256_shuffle_epi8(table.quarter[1], index), by_bit_4),
                            _mm256_blendv_epi8(_mm256_shuffle_epi8(table.quarter[2], index),
                                               _mm256_shuffle_epi8(table.quarter[3], index), by_bit_4),
                            by_bit_5);
}

// Most tiles are background, and most of that is too bright for a colour (ColorTable::LumaCeiling): it needs no look-up
// in the table of all colours. Of each pair of neighbours, which share their chroma, the darker one counts.
template <capture::PixelFormat format>
HUETRACK_AVX2_VERSION void classify_dark(const capture::Image& image, const ColorTable& table, const TileAt* tiles,
                                         std::size_t n, std::uint64_t* bits) {
  const SixBitTable of_u = six_bit_table(table.luma_ceiling().of_u.data()),
                    of_v = six_bit_table(table.luma_ceiling().of_v.data());
  const __m256i even = _mm256_set1_epi16(0xff);
  for (std::size_t i = 0; i < n; ++i) {
    const int u = tiles[i].pixel_u(), v = tiles[i].pixel_v();
    const TwoRows a = two_rows<format>(image, u, v), b = two_rows<format>(image, u, v + 2),
                  c = two_rows<format>(image, u, v + 4), d = two_rows<format>(image, u, v + 6);
    const __m256i y_upper = _mm256_set_m128i(b.y, a.y), y_lower = _mm256_set_m128i(d.y, c.y);
    const __m256i uv_upper = _mm256_set_m128i(b.uv, a.uv), uv_lower = _mm256_set_m128i(d.uv, c.uv);
    const __m256i darker =
        _mm256_packus_epi16(_mm256_and_si256(_mm256_min_epu8(y_upper, _mm256_srli_epi16(y_upper, 8)), even),
                            _mm256_and_si256(_mm256_min_epu8(y_lower, _mm256_srli_epi16(y_lower, 8)), even));
    const __m256i us = _mm256_packus_epi16(_mm256_and_si256(uv_upper, even), _mm256_and_si256(uv_lower, even));
    const __m256i vs = _mm256_packus_epi16(_mm256_srli_epi16(uv_upper, 8), _mm256_srli_epi16(uv_lower, 8));
    const __m256i ceiling = _mm256_min_epu8(looked_up(of_u, us), looked_up(of_v, vs));
    const int below = _mm256_movemask_epi8(_mm256_cmpeq_epi8(_mm256_min_epu8(darker, ceiling), darker));
    bits[i] = below != 0 ? classify_tile<format>(image, table, u, v) : 0;
  }
}

void classify_with_avx2(const capture::Image& image, const ColorTable& table, const TileAt* tiles, std::size_t n,
                        std::uint64_t* bits) {
  for_chroma_of(
      image.format, [&]<capture::PixelFormat format>() { classify_dark<format>(image, table, tiles, n, bits); },
      [&] { classify(image, table, tiles, n, bits); });
}
#endif

}  // namespace

const WindowKernels* avx2_window_kernels() {
#ifdef HUETRACK_AVX2_VERSION
  static const WindowKernels kernels{touched, classify_with_avx2, count};
  return __builtin_cpu_supports("avx2") != 0 ? &kernels : nullptr;
#else
  return nullptr;
#endif
}

const WindowKernels& portable_window_kernels() {
  static const WindowKernels kernels{touched, classify, count};
  return kernels;
}

const WindowKernels& best_window_kernels() {
  static const WindowKernels& best = avx512_window_kernels() != nullptr ? *avx512_window_kernels()
                                     : avx2_window_kernels() != nullptr ? *avx2_window_kernels()
                                                                        : portable_window_kernels();
  return best;
}

}  // namespace huetrack::color
