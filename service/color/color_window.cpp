#include "color/color_window.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>

#include "color/match_tiles.h"
#include "color/unit_filter.h"
#include "particle_filter/vector_clones.h"

namespace huetrack::color {
namespace {

constexpr int tile_size = TileAt::size;  // its powers are written out where that vectorises
static_assert(MatchBits::margin == tile_size);
constexpr std::uint64_t each_row = 0x0101010101010101u;

void store_word(std::uint8_t* p, std::uint64_t word) {
  if (std::endian::native != std::endian::little) word = __builtin_bswap64(word);
  std::memcpy(p, &word, 8);
}

}  // namespace

MatchBits::MatchBits(int width, int height, const WindowKernels& kernels)
    : kernels_(kernels),
      width_(width),
      height_(height),
      tile_stride_((width + tile_size - 1) / tile_size + 2),
      tile_rows_((height + tile_size - 1) / tile_size + 2),
      band_rows_(tile_size * tile_rows_),
      cell_stride_((2 * tile_stride_ + 7) / 8 * 8),  // whole words
      tile_frame_(static_cast<std::size_t>(tile_stride_ * tile_rows_ + 16), 0),
      bands_(static_cast<std::size_t>(2 * tile_stride_ * band_rows_ + 8), 0),  // a window at the end reads 8 rows
      mark_(static_cast<std::size_t>(2 * mark_front + cell_stride_ * (2 * tile_rows_ + 1)), 0),
      unknown_(static_cast<std::size_t>(tile_stride_ * tile_rows_ + 16)) {}

void MatchBits::ignore(const std::vector<PixelBox>& boxes) {
  ignored_.assign(boxes.empty() ? 0 : tile_frame_.size(), 0);
  for (const PixelBox& box : boxes) {
    for (int v = std::max(0, box.v_min); v <= std::min(box.v_max, height_ - 1); ++v) {
      for (int u = std::max(0, box.u_min); u <= std::min(box.u_max, width_ - 1); ++u) {
        const int tile = (v / tile_size + 1) * tile_stride_ + u / tile_size + 1;
        ignored_[static_cast<std::size_t>(tile)] |= std::uint64_t{1} << (tile_size * (v % tile_size) + u % tile_size);
      }
    }
  }
  in_boxes_ = ignored_;
}

void MatchBits::leave_out(std::size_t tile, std::uint64_t pixels, const UsualPixels* usual) {
  if (ignored_.empty()) ignored_.assign(tile_frame_.size(), 0);
  if (usual_.empty()) usual_.assign(tile_frame_.size(), nullptr);
  ignored_[tile] |= pixels;
  usual_[tile] = usual;
}

void MatchBits::leave_out_nothing() {
  ignored_ = in_boxes_;
  usual_.clear();
}

std::array<std::uint8_t, 3> MatchBits::values_at(int u, int v) const {
  if (on_demand_ != nullptr) on_demand_->require(u, v, u + 1, v + 1);
  if (image_.format == capture::PixelFormat::bgr) {
    const capture::Bgr p = capture::bgr_at(image_, u, v);
    return {p.b, p.g, p.r};
  }
  const capture::Yuv p = capture::yuv_at(image_, u, v);
  return {p.y, p.u, p.v};
}

std::array<float, 3> expected_values(const LightChange& light, const std::array<std::uint8_t, 3>& usual,
                                     capture::PixelFormat format) {
  const float zero = format == capture::PixelFormat::bgr ? 0 : 128;
  return {light.gain * float(usual[0]) + light.shift[0], light.gain * (float(usual[1]) - zero) + zero + light.shift[1],
          light.gain * (float(usual[2]) - zero) + zero + light.shift[2]};
}

std::uint64_t MatchBits::left_out(TileAt tile, std::uint64_t bits) const {
  if (ignored_.empty()) return 0;
  const auto at = static_cast<std::size_t>(tile.v * tile_stride_ + tile.u);
  const std::uint64_t ignored = bits & ignored_[at];
  if (ignored == 0 || found_ != nullptr || usual_.empty() || usual_[at] == nullptr) return ignored;
  const std::uint64_t in_boxes = in_boxes_.empty() ? 0 : ignored & in_boxes_[at];
  std::uint64_t out = in_boxes;
  for (std::uint64_t left = ignored & ~in_boxes; left != 0; left &= left - 1) {
    const int bit = std::countr_zero(left);
    const auto now = values_at(tile.pixel_u() + bit % tile_size, tile.pixel_v() + bit / tile_size);
    if (shows(light_, expected_values(light_, (*usual_[at])[static_cast<std::size_t>(bit)], image_.format), now))
      out |= std::uint64_t{1} << bit;
  }
  return out;
}

double MatchBits::change_at(int u, int v) const {
  const auto at = static_cast<std::size_t>((v / tile_size + 1) * tile_stride_ + u / tile_size + 1);
  const auto bit = static_cast<std::size_t>(tile_size * (v % tile_size) + u % tile_size);
  if (usual_.empty() || usual_[at] == nullptr || (ignored_[at] >> bit & 1) == 0)
    return std::numeric_limits<double>::infinity();
  const auto expected = expected_values(light_, (*usual_[at])[bit], image_.format);
  const auto now = values_at(u, v);
  double change = 0;
  for (std::size_t c = 0; c < 3; ++c)
    change += 2 * std::abs(double(now[c]) - double(expected[c])) / double(light_.gate[c]);
  return change;
}

std::uint64_t MatchBits::tile_with_left_out(TileAt tile) const {
  const int u = tile.pixel_u(), v = tile.pixel_v();
  if (u < 0 || v < 0 || u >= width_ || v >= height_) return 0;
  std::uint64_t bits = 0;
  if (is_inside(tile))
    classify({&tile, 1}, &bits);
  else
    bits = classify_edge(u, v);
  return in_boxes_.empty() ? bits : bits & ~in_boxes_[static_cast<std::size_t>(tile.v * tile_stride_ + tile.u)];
}

void MatchBits::grid(int step, std::vector<PixelAt>& hits) const {
  scan_grid(step, hits);
  if (ignored_.empty()) return;
  std::erase_if(hits, [&](const PixelAt& p) {
    const TileAt tile{static_cast<std::uint16_t>(p.u / tile_size + 1), static_cast<std::uint16_t>(p.v / tile_size + 1)};
    return left_out(tile, std::uint64_t{1} << (tile_size * (p.v % tile_size) + p.u % tile_size)) != 0;
  });
}

void MatchBits::grid_with_left_out(int step, std::vector<PixelAt>& hits) const {
  scan_grid(step, hits);
  if (in_boxes_.empty()) return;
  std::erase_if(hits, [&](const PixelAt& p) {
    const int tile = (p.v / tile_size + 1) * tile_stride_ + p.u / tile_size + 1;
    return (in_boxes_[static_cast<std::size_t>(tile)] >> (tile_size * (p.v % tile_size) + p.u % tile_size) & 1) != 0;
  });
}

void MatchBits::look_at(const capture::Image& image, const ColorTable& table) {
  image_ = image;
  on_demand_ = image.on_demand.get();
  image_.owner.reset();  // a camera's buffer is not kept until its next frame comes, if ever
  image_.on_demand.reset();
  bytes_per_pixel_ = image.format == capture::PixelFormat::yuyv ? 2 : image.format == capture::PixelFormat::bgr ? 3 : 1;
  table_ = &table;
  found_ = nullptr;
  look_anew();
}

void MatchBits::look_at(const capture::Matches::OfColor& matches) {
  found_ = matches.tiles.data();
  found_stride_ = static_cast<std::ptrdiff_t>(capture::tiles_across(width_));
  look_anew();
}

void MatchBits::look_anew() {
  if (++frame_ == 0) {  // after 2^32 frames the stamps would come round again
    std::ranges::fill(tile_frame_, 0u);
    frame_ = 1;
  }
}

void MatchBits::fill(std::span<const TileAt> tiles) {
  constexpr std::size_t group = 64;  // capacity:
  std::array<TileAt, group> inside;
  std::size_t n = 0;
  const auto flush = [&] { fill_inside({inside.data(), std::exchange(n, 0)}); };
  for (const TileAt tile : tiles) {
    const int u = tile.pixel_u(), v = tile.pixel_v();
    if (is_inside(tile)) {
      inside[n++] = tile;
      if (n == group) flush();
    } else if (u >= 0 && v >= 0 && u < width_ && v < height_) {  // else a margin tile: its bits stay 0
      ++tiles_looked_at_;
      const std::uint64_t bits = classify_edge(u, v);
      store({&tile, 1}, &bits);
    }
  }
  flush();
}

// In groups: their pixels come from memory together, and their bits stay in the nearest cache.
void MatchBits::fill_inside(std::span<const TileAt> tiles) {
  constexpr std::size_t group = 64;  // capacity:
  std::array<std::uint64_t, group> bits;
  tiles_looked_at_ += tiles.size();
  for (; !tiles.empty(); tiles = tiles.subspan(std::min(group, tiles.size()))) {
    const std::span<const TileAt> some = tiles.first(std::min(group, tiles.size()));
    classify(some, bits.data());
    store(some, bits.data());
  }
}

void MatchBits::classify(std::span<const TileAt> tiles, std::uint64_t* bits) const {
  if (found_ == nullptr) {
    require_tiles(on_demand_, tiles);
    fetch(tiles);
    kernels_.classify(image_, *table_, tiles.data(), tiles.size(), bits);
    return;
  }
  for (std::size_t i = 0; i < tiles.size(); ++i) bits[i] = found(tiles[i].pixel_u(), tiles[i].pixel_v());
}

void MatchBits::store(std::span<const TileAt> tiles, const std::uint64_t* bits) {
  constexpr std::uint64_t left_half = 0x0f * each_row, right_half = 0xf0 * each_row;
  std::uint8_t* const bands = bands_.data();  // copies of members: a store of bytes might change those
  const bool is_some_ignored = !ignored_.empty();
  const std::ptrdiff_t band_rows = band_rows_;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const TileAt tile = tiles[i];
    std::uint64_t word = bits[i];
    if (is_some_ignored) word &= ~left_out(tile, word);
    std::uint8_t* const middle = bands + 2 * tile.u * band_rows + tile_size * tile.v;
    if (load_word(middle) == word) continue;  // as most are, without any match: so are the halves that it has beside it
    std::uint8_t* const west = middle - band_rows;
    std::uint8_t* const east = middle + band_rows;
    store_word(middle, word);
    store_word(west, (load_word(west) & left_half) | (word << 4 & right_half));
    store_word(east, (load_word(east) & right_half) | (word >> 4 & left_half));
  }
}

// The tiles that the image's border cuts.
std::uint64_t MatchBits::classify_edge(int u0, int v0) const {
  if (found_ == nullptr && on_demand_ != nullptr) on_demand_->require(u0, v0, u0 + tile_size, v0 + tile_size);
  return found_ != nullptr ? found(u0, v0) : classify_cut_tile(image_, *table_, u0, v0);
}

// Brings the rows of tiles on their way from memory: a frame that was just captured is in no cache. Neighbours mostly
// share their cache lines.
void MatchBits::fetch(std::span<const TileAt> tiles) const {
  constexpr std::uintptr_t line = 64;
  const std::uint8_t* const pixels = image_.planes[0].data;
  const std::ptrdiff_t stride = image_.planes[0].stride, per_tile = tile_size * bytes_per_pixel_;
  std::uintptr_t last_line = 0;
  for (const TileAt tile : tiles) {
    const std::uint8_t* const p = pixels + tile.pixel_v() * stride + (tile.u - 1) * per_tile;
    const std::uintptr_t at = reinterpret_cast<std::uintptr_t>(p) / line;
    if (std::exchange(last_line, at) == at) continue;
    for (int r = 0; r < tile_size; ++r) __builtin_prefetch(p + r * stride);
  }
}

namespace {

struct CellBox {
  int u_min, v_min, u_max, v_max;
};

// Where each window lies, for all of them at vector speed. It begins in a cell of 4x4 pixels, and so touches that one
// and its three neighbours to the right and below; its band begins in the same cell. A window whose middle is not in
// the image gets the corner of the margin. Returns the cells in which those begin that are in the image.
HUETRACK_CLONES CellBox locate(const float* __restrict u, const float* __restrict v, std::size_t n, float width,
                               float height, std::int32_t cell_stride, std::int32_t band_rows,
                               std::int32_t* __restrict cell, std::int32_t* __restrict byte,
                               std::int32_t* __restrict shift) {
  std::int32_t* const left = cell;
  std::int32_t* const top = byte;
  for (std::size_t i = 0; i < n; ++i) {
    const float us = u[i] + 0.5f, vs = v[i] + 0.5f;  // the whole part is the pixel that (u, v) rounds to
    const bool in = (us >= 0) & (vs >= 0) & (us < width) & (vs < height);
    left[i] = in ? static_cast<std::int32_t>(in ? us : 0.0f) + MatchBits::margin - 2 : 0;
    top[i] = in ? static_cast<std::int32_t>(in ? vs : 0.0f) + MatchBits::margin - 2 : 0;
  }
  std::uint32_t u_min = ~0u, v_min = ~0u, u_max = 0, v_max = 0;  // less 1, so that outside is the largest of all
  for (std::size_t i = 0; i < n; ++i) {
    const std::int32_t l = left[i], t = top[i];
    u_min = std::min(u_min, static_cast<std::uint32_t>(l) - 1);
    v_min = std::min(v_min, static_cast<std::uint32_t>(t) - 1);
    u_max = std::max(u_max, static_cast<std::uint32_t>(l));
    v_max = std::max(v_max, static_cast<std::uint32_t>(t));
    shift[i] = (l & 3) | (l == 0 ? MatchBits::outside << 8 : 0);
    cell[i] = (t >> 2) * cell_stride + (l >> 2);
    byte[i] = (l >> 2) * band_rows + t;
  }
  if (u_max == 0) return {0, 0, -1, -1};
  return {static_cast<int>((u_min + 1) / 4), static_cast<int>((v_min + 1) / 4), static_cast<int>(u_max / 4),
          static_cast<int>(v_max / 4)};
}

}  // namespace

// Classifies the tiles that the marked windows touch, all unknown ones together, and clears the marks.
void MatchBits::look_at_marked(int cell_u_min, int cell_v_min, int cell_u_max, int cell_v_max) {
  // A tile is touched by windows that begin in its four cells, or in those to the left of and above them.
  const int first = cell_u_min / 2, count = (cell_u_max + 1) / 2 - first + 1;
  std::size_t n = 0;
  for (int tile_v = cell_v_min / 2; tile_v <= (cell_v_max + 1) / 2; ++tile_v) {
    n += kernels_.touched(marked() + std::ptrdiff_t{2} * tile_v * cell_stride_, cell_stride_,
                          &tile_frame_[static_cast<std::size_t>(tile_v * tile_stride_)], frame_, first, count, tile_v,
                          &unknown_[n]);
  }
  const int first_word = cell_u_min / 8, last_word = (cell_u_max + 1) / 8;
  for (int cell_v = cell_v_min; cell_v <= cell_v_max; ++cell_v) {
    std::uint8_t* const row = marked() + std::ptrdiff_t{cell_v} * cell_stride_;
    for (int w = first_word; w <= last_word; ++w) store_word(row + 8 * w, 0);
  }
  const std::span<const TileAt> tiles(unknown_.data(), n);
  const bool all_inside = first > 0 && cell_v_min >= 2 && (cell_u_max + 1) / 2 * tile_size <= width_ &&
                          (cell_v_max + 1) / 2 * tile_size <= height_;
  all_inside ? fill_inside(tiles) : fill(tiles);
}

void MatchBits::count_5x5(const float* u, const float* v, std::size_t n, std::uint8_t* k) {
  where_.resize(3 * n);
  std::int32_t *cell = where_.data(), *byte = cell + n, *shift = byte + n;
  const CellBox box = locate(u, v, n, static_cast<float>(width_), static_cast<float>(height_), cell_stride_, band_rows_,
                             cell, byte, shift);
  std::uint8_t* const marks = marked();
  for (std::size_t i = 0; i < n; ++i) marks[cell[i]] = 1;
  if (box.u_min <= box.u_max) look_at_marked(box.u_min, box.v_min, box.u_max, box.v_max);
  kernels_.count(bands_.data(), byte, shift, n, k);
}

bool MatchBits::at(int u, int v) {
  const int tile_u = (u + margin) / tile_size;
  look_at_tile(tile_u, (v + margin) / tile_size);
  return (*band(2 * tile_u, v + margin) >> u % tile_size & 1) != 0;
}

std::uint64_t MatchBits::row(int u, int v) const {
  const int left = u + margin, first = left / tile_size, count = std::min(8, tile_stride_ - first);
  const std::uint32_t* const frame =
      &tile_frame_[static_cast<std::size_t>((v + margin) / tile_size * tile_stride_ + first)];
  const std::uint8_t* byte = band(2 * first, v + margin);
  const std::ptrdiff_t to_next = std::ptrdiff_t{2} * band_rows_;
  std::uint64_t word = 0;
  for (int i = 0; i < count; ++i, byte += to_next) {
    const std::uint64_t known = frame[i] == frame_ ? *byte : 0u;
    word |= known << (8 * i);
  }
  return word >> left % tile_size;
}

bool MatchBits::has_any(int u, int v) const {
  const int first = (u + margin) / tile_size, tile_v = (v + margin) / tile_size;
  const int count = std::min(8, tile_stride_ - first);
  const std::uint32_t* const frame = &tile_frame_[static_cast<std::size_t>(tile_v * tile_stride_ + first)];
  const std::uint8_t* word = band(2 * first, tile_size * tile_v);
  std::uint64_t any = 0;
  for (int i = 0; i < count; ++i, word += std::ptrdiff_t{2} * band_rows_)
    any |= frame[i] == frame_ ? load_word(word) : 0u;
  return any != 0;
}

// capacity: decoding one tile of an image takes as long as bounds of so many
constexpr std::size_t tiles_as_bounds = 25;

void MatchBits::look(const PixelBox& box) {
  if (box.empty()) return;
  const auto first = [](int p) { return (std::max(p, 0) + margin) / tile_size; };
  const auto last = [](int p, int size) { return (std::min(p, size - 1) + margin) / tile_size; };
  std::size_t n = 0;
  for (int tv = first(box.v_min); tv <= last(box.v_max, height_); ++tv) {
    for (int tu = first(box.u_min); tu <= last(box.u_max, width_); ++tu) {
      std::uint32_t& known = tile_frame_[static_cast<std::size_t>(tv * tile_stride_ + tu)];
      if (std::exchange(known, frame_) == frame_) continue;
      unknown_[n++] = {static_cast<std::uint16_t>(tu), static_cast<std::uint16_t>(tv)};
    }
  }
  if (found_ == nullptr && on_demand_ != nullptr && n > tile_frame_.size() / tiles_as_bounds)
    n = without_impossible({unknown_.data(), n}, box);
  fill({unknown_.data(), n});
}

// Stores that tiles have no match whose bounds exclude the colour, and returns how many are left, in front.
std::size_t MatchBits::without_impossible(std::span<TileAt> tiles, const PixelBox& box) {
  // A tile reaches up to its size beyond the box.
  const UnitFilter filter(on_demand_, table_, 1,
                          {box.u_min - tile_size, box.v_min - tile_size, box.u_max + tile_size, box.v_max + tile_size});
  const auto is_impossible = [&](TileAt tile) {
    const bool is_in_image =
        tile.pixel_u() >= 0 && tile.pixel_v() >= 0 && tile.pixel_u() < width_ && tile.pixel_v() < height_;
    return is_in_image && !filter.may_match(tile.pixel_u(), tile.pixel_v());
  };
  constexpr std::uint64_t nothing = 0;
  std::size_t left = 0;
  for (const TileAt tile : tiles) {
    if (is_impossible(tile))
      store({&tile, 1}, &nothing);
    else
      tiles[left++] = tile;
  }
  return left;
}

namespace {

// A row's bytes on their way from memory, one of each cache line: of pixels far apart a processor foresees none.
void fetch_bytes(const std::uint8_t* row, std::size_t bytes) {
  constexpr std::size_t line = 64;
  for (std::size_t at = 0; at < bytes; at += line) __builtin_prefetch(row + at);
}

// Most of a picture is too bright for the colour, which two short tables show: the long one is seldom read.
bool is_below_ceiling(const ColorTable::LumaCeiling& ceiling, capture::Yuv p) {
  return p.y <= ceiling.of_u[p.u / 4] && p.y <= ceiling.of_v[p.v / 4];
}

}  // namespace

void MatchBits::fetch_row(int v) const {
  for (int plane = 0; plane < static_cast<int>(image_.planes.size()); ++plane) {
    const int rows = capture::plane_rows(image_.format, plane, height_);
    if (rows == 0) return;
    const capture::Plane& of = image_.planes[static_cast<std::size_t>(plane)];
    fetch_bytes(of.data + v * rows / height_ * of.stride, capture::plane_row_bytes(image_.format, plane, width_));
  }
}

void MatchBits::scan_grid(int step, std::vector<PixelAt>& hits) const {
  constexpr int rows_ahead = 2;  // layout: of prefetching
  hits.clear();
  const UnitFilter filter(found_ == nullptr ? on_demand_ : nullptr, table_, step);
  filter.require();
  const capture::Image& image = image_;
  const auto scan = [&](auto matches_at) {
    for (int v = step / 2; v < height_; v += step) {
      if (found_ == nullptr && v + rows_ahead * step < height_) fetch_row(v + rows_ahead * step);
      for (int u = step / 2; u < width_; u += step) {
        if (filter.may_match(u, v) && matches_at(u, v)) hits.push_back({u, v});
      }
    }
  };
  const auto byte = [&image](int plane, int r, int offset) {
    const capture::Plane& p = image.planes[static_cast<std::size_t>(plane)];
    return p.data[r * p.stride + offset];
  };
  if (found_ != nullptr)
    return scan([&](int u, int v) { return (found(u, v) >> (tile_size * (v % tile_size) + u % tile_size) & 1) != 0; });
  const ColorTable& table = *table_;
  const auto contains = [&](capture::Yuv p) { return is_below_ceiling(table.luma_ceiling(), p) && table.contains(p); };
  switch (image.format) {
    case capture::PixelFormat::yuyv:
      return scan([&](int u, int v) {
        return contains(capture::Yuv{byte(0, v, 2 * u), byte(0, v, 4 * (u / 2) + 1), byte(0, v, 4 * (u / 2) + 3)});
      });
    case capture::PixelFormat::i422:
      return scan([&](int u, int v) {
        return contains(capture::Yuv{byte(0, v, u), byte(1, v, u / 2), byte(2, v, u / 2)});
      });
    default:
      return scan([&](int u, int v) { return has_color(image, table, u, v); });
  }
}

}  // namespace huetrack::color
