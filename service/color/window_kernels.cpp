#include "color/window_kernels.h"

#include <bit>
#include <cstring>
#include <utility>

#include "particle_filter/vector_clones.h"

#if defined(__SSE2__)
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
template <capture::PixelFormat format>
std::uint64_t classify_tile(const capture::Image& image, const ColorTable& table, int u, int v) {
  const auto row = [&image](int plane, int r) {
    const capture::Plane& p = image.planes[static_cast<std::size_t>(plane)];
    return p.data + r * p.stride;
  };
  std::uint64_t bits = 0;
  for (int r = 0; r < 8; r += 2) {
    TwoRows rows;
    if constexpr (format == capture::PixelFormat::yuyv) {  // Y0 U Y1 V
      rows = split(row(0, v + r) + 2 * u, row(0, v + r + 1) + 2 * u);
    } else {
      rows.y = halves(row(0, v + r) + u, row(0, v + r + 1) + u);
      const int first = format == capture::PixelFormat::i422 ? v + r : (v + r) / 2;
      const int second = format == capture::PixelFormat::i422 ? v + r + 1 : first;
      rows.uv = format == capture::PixelFormat::nv12 ? halves(row(1, first) + u, row(1, second) + u)
                                                     : four_pairs(row(1, first) + u / 2, row(2, first) + u / 2,
                                                                  row(1, second) + u / 2, row(2, second) + u / 2);
    }
    bits |= static_cast<std::uint64_t>(of_two_rows(table.intervals(), rows)) << (8 * r);
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
  switch (image.format) {
    case capture::PixelFormat::yuyv:
      return classify_all(classify_tile<capture::PixelFormat::yuyv>, image, table, tiles, n, bits);
    case capture::PixelFormat::nv12:
      return classify_all(classify_tile<capture::PixelFormat::nv12>, image, table, tiles, n, bits);
    case capture::PixelFormat::i420:
      return classify_all(classify_tile<capture::PixelFormat::i420>, image, table, tiles, n, bits);
    case capture::PixelFormat::i422:
      return classify_all(classify_tile<capture::PixelFormat::i422>, image, table, tiles, n, bits);
    case capture::PixelFormat::i444:
    case capture::PixelFormat::bgr:
    case capture::PixelFormat::grey:
      return classify_all(classify_pixel_by_pixel, image, table, tiles, n, bits);
  }
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

}  // namespace

const WindowKernels& portable_window_kernels() {
  static const WindowKernels kernels{touched, classify, count};
  return kernels;
}

const WindowKernels& best_window_kernels() {
  static const WindowKernels& best =
      avx512_window_kernels() != nullptr ? *avx512_window_kernels() : portable_window_kernels();
  return best;
}

}  // namespace huetrack::color
