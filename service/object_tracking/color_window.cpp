#include "object_tracking/color_window.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "particle_filter/vector_clones.h"

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace huetrack {
namespace {

constexpr int tile_size = 8;               // its powers are written out where that vectorises
static_assert(MatchBits::margin == tile_size);
constexpr std::uint64_t each_row = 0x0101010101010101u;

bool matches(const Image& image, const ColorTable& table, int u, int v) {
  return image.format == PixelFormat::bgr ? table.contains(bgr_at(image, u, v)) : table.contains(yuv_at(image, u, v));
}

// Two rows of eight pixels whose neighbours share a chroma sample. y: 16 bytes, row after row; uv: the index u | v << 8 of
// each pair. Eight look-ups give the intervals of y; sixteen comparisons at once give the bits.
#ifdef __SSE2__
std::uint32_t classify_two_rows(const ColorTable::Interval* intervals, __m128i y, __m128i uv) {
  static_assert(sizeof(ColorTable::Interval) == 2);
  const auto interval = [&](int index) {
    std::uint16_t bytes;                  // y_min in the low byte, y_max in the high one
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
  const __m128i match = _mm_and_si128(_mm_cmpeq_epi8(_mm_max_epu8(y, low), y), _mm_cmpeq_epi8(_mm_min_epu8(y, high), y));
  return static_cast<std::uint32_t>(_mm_movemask_epi8(match));
}

__m128i two_halves(const void* low, const void* high) {
  return _mm_unpacklo_epi64(_mm_loadl_epi64(static_cast<const __m128i*>(low)), _mm_loadl_epi64(static_cast<const __m128i*>(high)));
}

__m128i four_bytes(const std::uint8_t* p) {
  std::int32_t bytes;
  std::memcpy(&bytes, p, 4);
  return _mm_cvtsi32_si128(bytes);
}
#endif

}  // namespace

MatchBits::MatchBits(int width, int height)
    : width_(width),
      height_(height),
      tile_stride_((width + tile_size - 1) / tile_size + 2),
      tiles_(static_cast<std::size_t>(tile_stride_) * static_cast<std::size_t>((height + tile_size - 1) / tile_size + 2)),
      needed_(tiles_.size() + 8, 0) {}

void MatchBits::look_at(const Image& image, const ColorTable& table) {
  image_ = image;
  table_ = &table;
  if (++frame_ == 0) {                    // after 2^32 frames the stamps would come round again
    for (Tile& tile : tiles_) tile.frame = 0;
    frame_ = 1;
  }
}

void MatchBits::fill(Tile& tile, int tile_u, int tile_v) {
  tile.frame = frame_;
  const int u = (tile_u - 1) * tile_size;
  const int v = (tile_v - 1) * tile_size;
  if (u < 0 || v < 0 || u >= width_ || v >= height_) return;            // a margin tile: its bits stay 0
  ++tiles_looked_at_;
  if (u + tile_size > width_ || v + tile_size > height_) {
    tile.bits = classify_edge(u, v);
    return;
  }
  switch (image_.format) {
    case PixelFormat::yuyv: tile.bits = classify<PixelFormat::yuyv>(u, v); break;
    case PixelFormat::nv12: tile.bits = classify<PixelFormat::nv12>(u, v); break;
    case PixelFormat::i420: tile.bits = classify<PixelFormat::i420>(u, v); break;
    case PixelFormat::i422: tile.bits = classify<PixelFormat::i422>(u, v); break;
    case PixelFormat::i444:
    case PixelFormat::bgr:
    case PixelFormat::grey: tile.bits = classify_edge(u, v); break;
  }
}

// Pixel by pixel: the tiles that the image's border cuts, and the formats without shared chroma.
std::uint64_t MatchBits::classify_edge(int u0, int v0) const {
  std::uint64_t bits = 0;
  for (int r = 0; r < std::min(tile_size, height_ - v0); ++r) {
    for (int c = 0; c < std::min(tile_size, width_ - u0); ++c) {
      bits |= static_cast<std::uint64_t>(matches(image_, *table_, u0 + c, v0 + r)) << (tile_size * r + c);
    }
  }
  return bits;
}

template <PixelFormat format>
std::uint64_t MatchBits::classify(int u, int v) const {
#ifdef __SSE2__
  const ColorTable::Interval* intervals = table_->intervals();
  const auto row = [this](int plane, int r) {
    const Plane& p = image_.planes[static_cast<std::size_t>(plane)];
    return p.data + r * p.stride;
  };
  std::uint64_t bits = 0;
  for (int r = 0; r < tile_size; r += 2) {
    __m128i y, uv;
    if constexpr (format == PixelFormat::yuyv) {                        // Y0 U Y1 V: luma in the even bytes, u v in the odd
      const __m128i a = _mm_loadu_si128(reinterpret_cast<const __m128i*>(row(0, v + r) + 2 * u));
      const __m128i b = _mm_loadu_si128(reinterpret_cast<const __m128i*>(row(0, v + r + 1) + 2 * u));
      const __m128i even = _mm_set1_epi16(0xff);
      y = _mm_packus_epi16(_mm_and_si128(a, even), _mm_and_si128(b, even));
      uv = _mm_packus_epi16(_mm_srli_epi16(a, 8), _mm_srli_epi16(b, 8));
    } else {
      y = two_halves(row(0, v + r) + u, row(0, v + r + 1) + u);
      const int first = format == PixelFormat::i422 ? v + r : (v + r) / 2;
      const int second = format == PixelFormat::i422 ? v + r + 1 : first;
      if constexpr (format == PixelFormat::nv12) {
        uv = two_halves(row(1, first) + u, row(1, second) + u);
      } else {
        uv = _mm_unpacklo_epi64(_mm_unpacklo_epi8(four_bytes(row(1, first) + u / 2), four_bytes(row(2, first) + u / 2)),
                                _mm_unpacklo_epi8(four_bytes(row(1, second) + u / 2), four_bytes(row(2, second) + u / 2)));
      }
    }
    bits |= static_cast<std::uint64_t>(classify_two_rows(intervals, y, uv)) << (tile_size * r);
  }
  return bits;
#else
  return classify_edge(u, v);
#endif
}

// Brings the rows of a tile on their way from memory: a frame that was just captured is in no cache.
void MatchBits::fetch(int tile_u, int tile_v) const {
  const int u = std::max(0, (tile_u - 1) * tile_size);
  const int v = std::max(0, (tile_v - 1) * tile_size);
  const int step = image_.format == PixelFormat::yuyv ? 2 : image_.format == PixelFormat::bgr ? 3 : 1;
  const std::uint8_t* p = image_.planes[0].data + v * image_.planes[0].stride + step * u;
  for (int r = 0; r < std::min(tile_size, height_ - v); ++r, p += image_.planes[0].stride) __builtin_prefetch(p);
}

namespace {

// Where each window lies, for all of them at vector speed. A window whose middle is not in the image gets the corner tile of
// the margin, which has no matches.
HUETRACK_CLONES void locate(const float* __restrict u, const float* __restrict v, std::size_t n, float width, float height,
                            std::int32_t tile_stride, std::int32_t* __restrict first, std::int32_t* __restrict right,
                            std::int32_t* __restrict below, std::int32_t* __restrict columns, std::int32_t* __restrict rows,
                            std::int32_t* __restrict inside) {
  for (std::size_t i = 0; i < n; ++i) {
    const float us = u[i] + 0.5f, vs = v[i] + 0.5f;   // the whole part is the pixel that (u, v) rounds to
    const bool in = (us >= 0) & (vs >= 0) & (us < width) & (vs < height);
    const std::int32_t left = in ? static_cast<std::int32_t>(in ? us : 0.0f) + MatchBits::margin - 2 : 0;
    const std::int32_t top = in ? static_cast<std::int32_t>(in ? vs : 0.0f) + MatchBits::margin - 2 : 0;
    first[i] = (top >> 3) * tile_stride + (left >> 3);
    right[i] = ((left + 4) >> 3) - (left >> 3);                        // 1 where it reaches into the next tile
    below[i] = (((top + 4) >> 3) - (top >> 3)) * tile_stride;
    columns[i] = left & 7;
    rows[i] = (top & 7) * 8;
    inside[i] = in ? 1 : 0;
  }
}

}  // namespace

HUETRACK_CLONES void MatchBits::count_5x5(const float* u, const float* v, std::size_t n, std::uint8_t* k) {
  where_.resize(6 * n);
  std::int32_t *first = where_.data(), *right = first + n, *below = right + n, *columns = below + n, *rows = columns + n,
               *inside = rows + n;
  locate(u, v, n, static_cast<float>(width_), static_cast<float>(height_), tile_stride_, first, right, below, columns, rows,
         inside);

  // The tiles that are needed, marked without a branch or a load; then those of them that nobody has looked at yet, all
  // together, so that the memory works on many at a time.
  Tile* const tiles = tiles_.data();
  std::uint8_t* const needed = needed_.data();
  std::int32_t lowest = std::numeric_limits<std::int32_t>::max(), highest = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const std::int32_t t = first[i];
    lowest = std::min(lowest, t);
    highest = std::max(highest, t);
    needed[t] = needed[t + right[i]] = needed[t + below[i]] = needed[t + below[i] + right[i]] = 1;
  }
  highest += tile_stride_ + 1;
  unknown_.clear();
  for (std::int32_t t = lowest; t <= highest; t += 8) {                 // needed_ has 8 bytes to spare at its end
    std::uint64_t eight;
    std::memcpy(&eight, needed + t, 8);
    if (eight == 0) continue;
    std::memset(needed + t, 0, 8);
    for (; eight != 0; eight &= eight - 1) {
      const std::int32_t at = t + std::countr_zero(eight) / 8;
      if (tiles[at].frame == frame_) continue;
      tiles[at].frame = frame_;
      unknown_.push_back(at);
      fetch(at % tile_stride_, at / tile_stride_);
    }
  }
  for (const std::int32_t t : unknown_) fill(tiles[t], t % tile_stride_, t / tile_stride_);

  for (std::size_t i = 0; i < n; ++i) {
    const Tile* const tile = tiles + first[i];
    // The rows from the window's top on: a byte is a row. (Shifted twice, because a shift by 64 is undefined.)
    const std::uint64_t west = tile[0].bits >> rows[i] | (tile[below[i]].bits << (63 - rows[i])) << 1;
    const std::uint64_t east = tile[right[i]].bits >> rows[i] | (tile[below[i] + right[i]].bits << (63 - rows[i])) << 1;
    // The columns from its left on, five of them, of five rows.
    const std::uint64_t from_west = (west >> columns[i]) & (each_row * (0xffu >> columns[i]));
    const std::uint64_t from_east = (east << (8 - columns[i])) & (each_row * (0xffu & ~(0xffu >> columns[i])));
    const int count = std::popcount((from_west | from_east) & 0x1f1f1f1f1fu);
    k[i] = static_cast<std::uint8_t>(inside[i] != 0 ? count : outside);
  }
}

bool MatchBits::at(int u, int v) {
  const Tile& tile = tile_at((u + margin) / tile_size, (v + margin) / tile_size);
  return (tile.bits >> (tile_size * (v % tile_size) + u % tile_size) & 1) != 0;
}

std::uint64_t MatchBits::row(int u, int v) const {
  const int left = u + margin;
  const int byte = 8 * (v % tile_size);
  const Tile* tile = &tiles_[static_cast<std::size_t>((v + margin) / tile_size * tile_stride_)];
  std::uint64_t word = 0;
  for (int i = 0; i < 8; ++i) {
    const int tile_u = left / tile_size + i;
    if (tile_u < tile_stride_ && tile[tile_u].frame == frame_) word |= (tile[tile_u].bits >> byte & 0xff) << (8 * i);
  }
  return word >> left % tile_size;
}

void MatchBits::look(const PixelBox& box) {
  if (box.empty()) return;
  const auto first = [](int p) { return (std::max(p, 0) + margin) / tile_size; };
  const auto last = [](int p, int size) { return (std::min(p, size - 1) + margin) / tile_size; };
  for (int tv = first(box.v_min); tv <= last(box.v_max, height_); ++tv) {
    for (int tu = first(box.u_min); tu <= last(box.u_max, width_); ++tu) tile_at(tu, tv);
  }
}

void MatchBits::grid(int step, std::vector<PixelAt>& hits) const {
  hits.clear();
  const Image& image = image_;
  const auto scan = [&](auto matches_at) {
    for (int v = step / 2; v < height_; v += step) {
      for (int u = step / 2; u < width_; u += step) {
        if (matches_at(u, v)) hits.push_back({u, v});
      }
    }
  };
  const auto byte = [&image](int plane, int r, int offset) {
    const Plane& p = image.planes[static_cast<std::size_t>(plane)];
    return p.data[r * p.stride + offset];
  };
  const ColorTable& table = *table_;
  switch (image.format) {
    case PixelFormat::yuyv:
      return scan([&](int u, int v) {
        return table.contains(Yuv{byte(0, v, 2 * u), byte(0, v, 4 * (u / 2) + 1), byte(0, v, 4 * (u / 2) + 3)});
      });
    case PixelFormat::i422:
      return scan([&](int u, int v) { return table.contains(Yuv{byte(0, v, u), byte(1, v, u / 2), byte(2, v, u / 2)}); });
    default: return scan([&](int u, int v) { return matches(image, table, u, v); });
  }
}

int count_5x5_reference(const Image& image, const ColorTable& table, int u, int v) {
  int k = 0;
  for (int dv = -2; dv <= 2; ++dv) {
    for (int du = -2; du <= 2; ++du) {
      const int uu = u + du, vv = v + dv;
      if (uu >= 0 && vv >= 0 && uu < image.width && vv < image.height && matches(image, table, uu, vv)) ++k;
    }
  }
  return k;
}

}  // namespace huetrack
