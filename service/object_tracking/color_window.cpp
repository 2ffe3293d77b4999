#include "object_tracking/color_window.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace huetrack {
namespace {

constexpr int tile = 8;      // pixels; the bits of one row of a tile are one byte
static_assert(MatchBits::margin == tile);

// A byte 0 or 1 per pixel to a bit per pixel, lowest first.
std::uint8_t pack8(const std::uint8_t* match) {
  std::uint64_t bytes;
  std::memcpy(&bytes, match, 8);
  return static_cast<std::uint8_t>((bytes * 0x0102040810204080u) >> 56);
}

// The match bytes of two neighbours that share one chroma sample: one look-up.
void classify_pair(const ColorTable::Interval* intervals, std::uint8_t y0, std::uint8_t y1, std::uint8_t u, std::uint8_t v,
                   std::uint8_t* match) {
  const ColorTable::Interval i = intervals[static_cast<unsigned>(u) | static_cast<unsigned>(v) << 8];
  match[0] = static_cast<std::uint8_t>((y0 >= i.y_min) & (y0 <= i.y_max));
  match[1] = static_cast<std::uint8_t>((y1 >= i.y_min) & (y1 <= i.y_max));
}

bool matches(const Image& image, const ColorTable& table, int u, int v) {
  return image.format == PixelFormat::bgr ? table.contains(bgr_at(image, u, v)) : table.contains(yuv_at(image, u, v));
}

}  // namespace

MatchBits::MatchBits(int width, int height)
    : width_(width),
      height_(height),
      tile_stride_((width + tile - 1) / tile + 2),
      row_stride_(tile_stride_ + 8),      // 8 more bytes: row() reads a word
      looked_at_(static_cast<std::size_t>(tile_stride_) * static_cast<std::size_t>((height + tile - 1) / tile + 2), 0),
      bits_(static_cast<std::size_t>(row_stride_) * static_cast<std::size_t>((height + tile - 1) / tile + 2) * tile, 0) {}

void MatchBits::look_at(const Image& image, const ColorTable& table) {
  image_ = image;
  table_ = &table;
  if (++frame_ == 0) {                    // after 2^32 frames the stamps would come round again
    std::ranges::fill(looked_at_, 0);
    frame_ = 1;
  }
}

void MatchBits::fill_tile(int tile_u, int tile_v) {
  std::uint32_t& stamp = looked_at_[static_cast<std::size_t>(tile_v * tile_stride_ + tile_u)];
  if (stamp == frame_) return;
  stamp = frame_;
  const int u = (tile_u - 1) * tile;
  const int v = (tile_v - 1) * tile;
  if (u < 0 || v < 0 || u >= width_ || v >= height_) return;            // a margin tile: its bits stay 0
  ++tiles_looked_at_;
  switch (image_.format) {
    case PixelFormat::yuyv: return fill_tile_as<PixelFormat::yuyv>(u, v);
    case PixelFormat::nv12: return fill_tile_as<PixelFormat::nv12>(u, v);
    case PixelFormat::i420: return fill_tile_as<PixelFormat::i420>(u, v);
    case PixelFormat::i422: return fill_tile_as<PixelFormat::i422>(u, v);
    case PixelFormat::i444: return fill_tile_as<PixelFormat::i444>(u, v);
    case PixelFormat::bgr: return fill_tile_as<PixelFormat::bgr>(u, v);
    case PixelFormat::grey: return fill_tile_as<PixelFormat::grey>(u, v);
  }
}

template <PixelFormat format>
void MatchBits::fill_tile_as(int u0, int v0) {
  const int columns = std::min(tile, width_ - u0);
  const int rows = std::min(tile, height_ - v0);
  std::uint8_t* out = bits_.data() + (v0 + margin) * row_stride_ + (u0 + margin) / 8;
  const ColorTable::Interval* intervals = table_->intervals();
  for (int r = 0; r < rows; ++r, out += row_stride_) {
    const int v = v0 + r;
    std::uint8_t match[tile] = {};
    const bool whole_pairs = columns == tile;
    if constexpr (format == PixelFormat::yuyv) {
      if (whole_pairs) {
        const std::uint8_t* p = image_.planes[0].data + v * image_.planes[0].stride + 2 * u0;
        for (int i = 0; i < tile; i += 2, p += 4) classify_pair(intervals, p[0], p[2], p[1], p[3], match + i);
        *out = pack8(match);
        continue;
      }
    } else if constexpr (format == PixelFormat::nv12 || format == PixelFormat::i420 || format == PixelFormat::i422) {
      if (whole_pairs) {
        const int chroma_v = format == PixelFormat::i422 ? v : v / 2;
        const std::uint8_t* y = image_.planes[0].data + v * image_.planes[0].stride + u0;
        const std::uint8_t* u_row = image_.planes[1].data + chroma_v * image_.planes[1].stride;
        if constexpr (format == PixelFormat::nv12) {
          u_row += u0;
          for (int i = 0; i < tile; i += 2) classify_pair(intervals, y[i], y[i + 1], u_row[i], u_row[i + 1], match + i);
        } else {
          u_row += u0 / 2;
          const std::uint8_t* v_row = image_.planes[2].data + chroma_v * image_.planes[2].stride + u0 / 2;
          for (int i = 0; i < tile; i += 2) classify_pair(intervals, y[i], y[i + 1], u_row[i / 2], v_row[i / 2], match + i);
        }
        *out = pack8(match);
        continue;
      }
    }
    for (int i = 0; i < columns; ++i) match[i] = static_cast<std::uint8_t>(matches(image_, *table_, u0 + i, v));
    *out = pack8(match);
  }
}

void MatchBits::count_5x5(const float* u, const float* v, std::size_t n, std::uint8_t* k) {
  const auto width = static_cast<float>(width_);
  const auto height = static_cast<float>(height_);
  const std::uint8_t* const bits = bits_.data();
  for (std::size_t i = 0; i < n; ++i) {
    const float u_shifted = u[i] + 0.5f;              // its whole part is the pixel that (u, v) rounds to
    const float v_shifted = v[i] + 0.5f;
    if (!(u_shifted >= 0 && v_shifted >= 0 && u_shifted < width && v_shifted < height)) {
      k[i] = outside;
      continue;
    }
    const int left = static_cast<int>(u_shifted) + margin - 2;
    const int top = static_cast<int>(v_shifted) + margin - 2;
    const int tile_left = left / tile, tile_right = (left + 4) / tile;
    const int tile_top = top / tile, tile_bottom = (top + 4) / tile;
    ensure(tile_left, tile_top);
    ensure(tile_right, tile_top);
    ensure(tile_left, tile_bottom);
    ensure(tile_right, tile_bottom);
    const std::uint8_t* p = bits + top * row_stride_ + left / 8;
    std::uint32_t window = 0;
    for (int r = 0; r < 5; ++r, p += row_stride_) {
      std::uint16_t two;
      std::memcpy(&two, p, 2);
      window |= ((static_cast<std::uint32_t>(two) >> (left & 7)) & 31u) << (5 * r);
    }
    k[i] = static_cast<std::uint8_t>(std::popcount(window));
  }
}

bool MatchBits::at(int u, int v) {
  ensure((u + margin) / tile, (v + margin) / tile);
  return (bits_[static_cast<std::size_t>((v + margin) * row_stride_ + (u + margin) / 8)] >> ((u + margin) & 7) & 1) != 0;
}

std::uint64_t MatchBits::row(int u, int v) const {
  const int left = u + margin;
  std::uint64_t word;
  std::memcpy(&word, bits_.data() + (v + margin) * row_stride_ + left / 8, 8);
  return word >> (left & 7);
}

void MatchBits::look(const PixelBox& box) {
  if (box.empty()) return;
  const auto first = [](int p) { return (std::max(p, 0) + margin) / tile; };
  const auto last = [](int p, int size) { return (std::min(p, size - 1) + margin) / tile; };
  for (int tv = first(box.v_min); tv <= last(box.v_max, height_); ++tv) {
    for (int tu = first(box.u_min); tu <= last(box.u_max, width_); ++tu) ensure(tu, tv);
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
