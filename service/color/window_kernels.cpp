#include "color/window_kernels.h"

#include <algorithm>
#include <array>
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

[[gnu::always_inline]] inline __m128i intervals_of_eight(const ColorTable::Interval* intervals, __m128i uv) {
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
  return _mm_insert_epi16(i, interval(_mm_extract_epi16(uv, 7)), 7);
}

std::uint32_t of_two_rows(const ColorTable::Interval* intervals, const TwoRows& rows) {
  const auto [y, uv] = rows;
  const __m128i i = intervals_of_eight(intervals, uv);
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
HUETRACK_AVX2_VERSION inline __m256i load256(const void* p) {
  return _mm256_loadu_si256(static_cast<const __m256i*>(p));
}

// As TwoRows, of two tiles: the lower half of one, the upper half of the other.
struct TwoRowsOfTwo {
  __m256i y, uv;
};

// Rows r and r + 1 of tiles a and b; is_next: b is the one to the right of a, so that a row of both is one load.
template <capture::PixelFormat format, bool is_next>
HUETRACK_AVX2_VERSION inline TwoRowsOfTwo two_rows_of_two(const capture::Image& image, TileAt a, TileAt b, int r) {
  if constexpr (format == capture::PixelFormat::yuyv && is_next) {
    const std::ptrdiff_t stride = image.planes[0].stride;
    const std::uint8_t* const p = image.planes[0].data + a.pixel_v() * stride + 2 * a.pixel_u() + r * stride;
    const __m256i first = load256(p), second = load256(p + stride), even = _mm256_set1_epi16(0xff);
    return {_mm256_packus_epi16(_mm256_and_si256(first, even), _mm256_and_si256(second, even)),
            _mm256_packus_epi16(_mm256_srli_epi16(first, 8), _mm256_srli_epi16(second, 8))};
  } else {
    const TwoRows of_a = two_rows<format>(image, a.pixel_u(), a.pixel_v() + r),
                  of_b = two_rows<format>(image, b.pixel_u(), b.pixel_v() + r);
    return {_mm256_set_m128i(of_b.y, of_a.y), _mm256_set_m128i(of_b.uv, of_a.uv)};
  }
}

// By how much the darker pixel of each pair is brighter than its chroma allows (ColorTable::LumaCeiling), in the even
// bytes; of_u, of_v: the ceilings near grey.
HUETRACK_AVX2_VERSION inline __m256i above_ceiling(__m256i of_u, __m256i of_v, TwoRowsOfTwo rows) {
  using Ceiling = ColorTable::LumaCeiling;
  const __m256i from_first =  // 0 to 63, all beyond that counted as if it were there
      _mm256_subs_epu8(_mm256_adds_epu8(rows.uv, _mm256_set1_epi8(255 - Ceiling::last_near_grey)),
                       _mm256_set1_epi8(static_cast<char>(255 - Ceiling::last_near_grey + Ceiling::first_near_grey)));
  const __m256i quarters = _mm256_and_si256(_mm256_srli_epi16(from_first, 2), _mm256_set1_epi8(0x0f));
  const __m256i ceiling =
      _mm256_min_epu8(_mm256_shuffle_epi8(of_u, quarters), _mm256_shuffle_epi8(of_v, _mm256_srli_epi16(quarters, 8)));
  return _mm256_subs_epu8(_mm256_min_epu8(rows.y, _mm256_srli_epi16(rows.y, 8)), ceiling);
}

// As of_two_rows(); the other tile's in the upper half.
HUETRACK_AVX2_VERSION inline std::uint32_t of_two_rows_of_two(const ColorTable::Interval* intervals,
                                                              TwoRowsOfTwo rows) {
  const auto [y, uv] = rows;
  const __m256i i = _mm256_set_m128i(intervals_of_eight(intervals, _mm256_extracti128_si256(uv, 1)),
                                     intervals_of_eight(intervals, _mm256_castsi256_si128(uv)));
  const __m256i even = _mm256_set1_epi16(0xff);
  const __m256i low = _mm256_or_si256(_mm256_and_si256(i, even), _mm256_slli_epi16(i, 8));
  const __m256i high = _mm256_or_si256(_mm256_srli_epi16(i, 8), _mm256_andnot_si256(even, i));
  const __m256i match =
      _mm256_and_si256(_mm256_cmpeq_epi8(_mm256_max_epu8(y, low), y), _mm256_cmpeq_epi8(_mm256_min_epu8(y, high), y));
  return static_cast<std::uint32_t>(_mm256_movemask_epi8(match));
}

HUETRACK_AVX2_VERSION inline __m256i sixteen(const std::array<std::uint8_t, 16>& bytes) {
  return _mm256_broadcastsi128_si256(_mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes.data())));
}

struct NearGreyCeilings {
  __m256i of_u, of_v;
};

// Most tiles are background, and most of that is too bright for a colour: it needs no look-up in the table of all
// colours. Of each pair of neighbours, which share their chroma, the darker one counts.
template <capture::PixelFormat format, bool is_next>
HUETRACK_AVX2_VERSION inline void classify_two(const capture::Image& image, const ColorTable::Interval* intervals,
                                               const NearGreyCeilings& ceilings, TileAt a, TileAt b,
                                               std::uint64_t& bits_of_a, std::uint64_t& bits_of_b) {
  TwoRowsOfTwo rows[4];
#pragma GCC unroll 4
  for (int k = 0; k < 4; ++k) rows[k] = two_rows_of_two<format, is_next>(image, a, b, 2 * k);
  const auto [of_u, of_v] = ceilings;
  const __m256i above =
      _mm256_min_epu8(_mm256_min_epu8(above_ceiling(of_u, of_v, rows[0]), above_ceiling(of_u, of_v, rows[1])),
                      _mm256_min_epu8(above_ceiling(of_u, of_v, rows[2]), above_ceiling(of_u, of_v, rows[3])));
  std::uint64_t first = 0, second = 0;
  if (_mm256_testz_si256(_mm256_cmpeq_epi8(above, _mm256_setzero_si256()), _mm256_set1_epi16(0xff)) == 0) {
    for (int k = 0; k < 4; ++k) {
      const std::uint32_t found = of_two_rows_of_two(intervals, rows[k]);
      first |= std::uint64_t{found & 0xffff} << (16 * k);
      second |= std::uint64_t{found >> 16} << (16 * k);
    }
  }
  bits_of_a = first;
  bits_of_b = second;
}

template <capture::PixelFormat format>
HUETRACK_AVX2_VERSION void classify_by_twos(const capture::Image& image, const ColorTable& table, const TileAt* tiles,
                                            std::size_t n, std::uint64_t* bits) {
  const NearGreyCeilings ceilings{sixteen(table.luma_ceiling().near_grey_of_u),
                                  sixteen(table.luma_ceiling().near_grey_of_v)};
  const ColorTable::Interval* const intervals = table.intervals();
  for (std::size_t i = 0; i < n; i += 2) {
    const std::size_t j = std::min(i + 1, n - 1);  // the last one of an odd number with itself
    const TileAt a = tiles[i], b = tiles[j];
    if (b.u == a.u + 1 && b.v == a.v)
      classify_two<format, true>(image, intervals, ceilings, a, b, bits[i], bits[j]);
    else
      classify_two<format, false>(image, intervals, ceilings, a, b, bits[i], bits[j]);
  }
}

void classify_with_avx2(const capture::Image& image, const ColorTable& table, const TileAt* tiles, std::size_t n,
                        std::uint64_t* bits) {
  for_chroma_of(
      image.format, [&]<capture::PixelFormat format>() { classify_by_twos<format>(image, table, tiles, n, bits); },
      [&] { classify(image, table, tiles, n, bits); });
}

HUETRACK_AVX2_VERSION inline __m256i cell_and_left(const std::uint8_t* p) {
  return _mm256_or_si256(load256(p), load256(p - 1));
}

// Of each byte the places of its ones, from the lowest on.
constexpr std::array<std::uint64_t, 256> places_of_ones = [] {
  std::array<std::uint64_t, 256> out{};
  for (unsigned byte = 0; byte < 256; ++byte) {
    for (unsigned place = 0, ones = 0; place < 8; ++place) {
      if ((byte >> place & 1) != 0) out[byte] |= std::uint64_t{place} << (8 * ones++);
    }
  }
  return out;
}();

// Sixteen tiles at a time: a lane of 16 bits has two cells.
HUETRACK_AVX2_VERSION std::size_t touched_with_avx2(const std::uint8_t* marked, std::ptrdiff_t cell_stride,
                                                    std::uint32_t* known, std::uint32_t frame, int first, int count,
                                                    int tile_v, TileAt* tiles) {
  static_assert(sizeof(TileAt) == 4);
  const __m256i now = _mm256_set1_epi32(static_cast<int>(frame)), zero = _mm256_setzero_si256();
  const __m256i steps = _mm256_setr_epi16(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  constexpr int in_order = 0b11'01'10'00;  // packing goes half by half
  std::size_t n = 0;
  for (int u = first; u < first + count; u += 16) {
    const std::uint8_t* const p = marked + 2 * u;
    const __m256i any = _mm256_or_si256(_mm256_or_si256(cell_and_left(p), cell_and_left(p - cell_stride)),
                                        cell_and_left(p + cell_stride));
    const __m256i frames[2] = {load256(known + u), load256(known + u + 8)};
    const __m256i are_known = _mm256_permute4x64_epi64(
        _mm256_packs_epi32(_mm256_cmpeq_epi32(frames[0], now), _mm256_cmpeq_epi32(frames[1], now)), in_order);
    const __m256i in_row = _mm256_cmpgt_epi16(_mm256_set1_epi16(static_cast<short>(first + count - u)), steps);
    const __m256i unknown = _mm256_andnot_si256(_mm256_or_si256(_mm256_cmpeq_epi16(any, zero), are_known), in_row);
    const __m128i halves[2] = {_mm256_castsi256_si128(unknown), _mm256_extracti128_si256(unknown, 1)};
    for (int h = 0; h < 2; ++h) {
      const __m256i mask = _mm256_cvtepi16_epi32(halves[h]);
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(known + u + 8 * h), _mm256_blendv_epi8(frames[h], now, mask));
      const auto ones = static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(mask)));
      const __m256i places = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(places_of_ones[ones])));
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(tiles + n),
                          _mm256_add_epi32(places, _mm256_set1_epi32((u + 8 * h) | tile_v << 16)));
      n += static_cast<std::size_t>(std::popcount(ones));
    }
  }
  return n;
}

// How many ones each lane of 64 bits has.
HUETRACK_AVX2_VERSION inline __m256i ones_of(__m256i words) {
  const __m256i of_nibble = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4,  //
                                             0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4);
  const __m256i nibble = _mm256_set1_epi8(0x0f);
  const __m256i ones =
      _mm256_add_epi8(_mm256_shuffle_epi8(of_nibble, _mm256_and_si256(words, nibble)),
                      _mm256_shuffle_epi8(of_nibble, _mm256_and_si256(_mm256_srli_epi16(words, 4), nibble)));
  return _mm256_sad_epu8(ones, _mm256_setzero_si256());
}

HUETRACK_AVX2_VERSION void count_with_avx2(const std::uint8_t* bands, const std::int32_t* byte,
                                           const std::int32_t* shift, std::size_t n, std::uint8_t* k) {
  const std::size_t whole = n / 4 * 4;
  for (std::size_t i = 0; i < whole; i += 4) {
    const auto word = [&](std::size_t j) { return static_cast<long long>(load_word(bands + byte[i + j])); };
    const __m256i rows = _mm256_setr_epi64x(word(0), word(1), word(2), word(3));
    const __m128i by = _mm_loadu_si128(reinterpret_cast<const __m128i*>(shift + i));
    const __m256i window =
        _mm256_and_si256(_mm256_srlv_epi64(rows, _mm256_cvtepu32_epi64(_mm_and_si128(by, _mm_set1_epi32(3)))),
                         _mm256_set1_epi64x(0x1f1f1f1f1f));
    const __m256i counted = _mm256_or_si256(ones_of(window), _mm256_cvtepu32_epi64(_mm_srli_epi32(by, 8)));
    const __m256i low =
        _mm256_shuffle_epi8(counted, _mm256_setr_epi8(0, 8, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1,
                                                      -1, 0, 8, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1));
    const int four = _mm_cvtsi128_si32(_mm_or_si128(_mm256_castsi256_si128(low), _mm256_extracti128_si256(low, 1)));
    std::memcpy(k + i, &four, 4);
  }
  count(bands, byte + whole, shift + whole, n - whole, k + whole);
}
#endif

}  // namespace

const WindowKernels* avx2_window_kernels() {
#ifdef HUETRACK_AVX2_VERSION
  static const WindowKernels kernels{touched_with_avx2, classify_with_avx2, count_with_avx2};
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
