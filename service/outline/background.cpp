#include "outline/background.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "particle_filter/vector_clones.h"

namespace huetrack::outline {
namespace {

struct BackgroundTuning {
  float gate_sigmas = 5;           // a value within so many standard deviations of the mean is the same background
  float min_gate = 8;              // grey values; the gate's lower limit (experiment)
  int count_lost_per_outlier = 2;  // pictures by which a value beyond the gate lowers the count (experiment)
  float min_light_noise = 0.7f;    // grey values, 1 sigma; quantisation alone is 0.3
  float min_chroma_noise = 0.5f;   // grey values, 1 sigma
  double noise_kept = 0.98;        // of the noise statistics, from tile to tile
  std::uint32_t known_count = 4;   // updates of a tile; with fewer it is hardly known
  int min_tiles = 2;               // updated near the object, per picture
  int max_tiles = 5;               // the same, of a large object
  int disc_px2_per_tile = 32;      // squared radius for which one tile is updated (experiment)
  int hardly_known_tiles = 16;     // updated at once while tiles near the object are hardly known
  int pictures_to_see_all = 30;    // after which every tile was updated once: 1 s at 30 Hz
};
constexpr BackgroundTuning background_tuning{};
constexpr int settled_count = background_noise.max_count / 2;  // the mean is good enough to measure the noise
constexpr int margin_px = Background::tile_px / 2;             // around the object, of what is learnt first
constexpr double tile_reach_px = 0.7 * Background::tile_px;    // maths: half a tile's diagonal
constexpr double mean_abs_of_normal = 0.798;                   // maths: E|x| = sqrt(2 / pi) sigma
constexpr double min_noise_samples = 500;                      // maths: 4 % of the noise, 1 sigma
constexpr int full_share = 1 << 15;                            // layout: shares of 16 bits

constexpr int size = Background::tile_px;
constexpr int tile_samples = size * size;

// Deviations of settled samples from their mean.
struct Deviations {
  std::int32_t sum, count;
};
template <int n>
inline __attribute__((always_inline)) Deviations update_of(const std::int16_t* __restrict seen,
                                                           const std::int16_t* __restrict hidden, int gate,
                                                           std::int16_t* __restrict mean,
                                                           const std::uint8_t* __restrict counts,
                                                           std::int16_t* __restrict count_now) {
  // Gain of a mean over so many pictures, this one included, in 2^-15; at most 1/2.
  alignas(64) std::int16_t share[n], off[n], settled[n];
  alignas(64) std::int32_t whole[n];
  std::uint8_t fewest = background_noise.max_count;
  for (int i = 0; i < n; ++i) fewest = counts[i] < fewest ? counts[i] : fewest;
  if (fewest + 1 >= background_noise.max_count) {  // all samples are known
    for (int i = 0; i < n; ++i) share[i] = full_share / background_noise.max_count;
  } else {
    for (int i = 0; i < n; ++i) whole[i] = counts[i];
    for (int i = 0; i < n; ++i) {
      const int more = whole[i] + 1 < background_noise.max_count ? whole[i] + 1 : background_noise.max_count;
      whole[i] = static_cast<std::int32_t>(full_share / static_cast<float>(more < 2 ? 2 : more));
    }
    for (int i = 0; i < n; ++i) share[i] = static_cast<std::int16_t>(whole[i]);
  }
  // One number type, and all bits set for true, so that compilers vectorise the loop.
  using Number = std::int16_t;
  const auto near = static_cast<Number>(gate < 32767 ? gate : 32767);
  for (int i = 0; i < n; ++i) count_now[i] = counts[i];
  for (int i = 0; i < n; ++i) {
    const Number before = mean[i], of = count_now[i], is_hidden = hidden[i];
    const auto by = static_cast<Number>(seen[i] - before);
    const auto far = static_cast<Number>(by < 0 ? -by : by);
    const Number is_near = far < near ? -1 : 0, is_known = of > 0 ? -1 : 0;
    const auto is_same = static_cast<Number>(is_near & is_known);
    const auto more = static_cast<Number>(of + 1 < background_noise.max_count ? of + 1 : background_noise.max_count);
    const auto fewer = static_cast<Number>(of - background_tuning.count_lost_per_outlier);
    const Number is_gone = fewer <= 0 ? -1 : 0;
    const auto is_new = static_cast<Number>(~is_same & is_gone);
    const auto part = static_cast<Number>(((by * share[i] >> 14) + 1) >> 1);
    const auto moved = static_cast<Number>(((part & is_same) | (by & is_new)) & ~is_hidden);
    const auto then = static_cast<Number>((more & is_same) | (is_new & 1) | (fewer & ~is_same & ~is_new));
    mean[i] = static_cast<Number>(before + moved);
    count_now[i] = static_cast<Number>((then & ~is_hidden) | (of & is_hidden));
    const Number is_settled = of >= settled_count ? -1 : 0;
    settled[i] = static_cast<Number>(is_settled & is_same & ~is_hidden & 1);
    off[i] = static_cast<Number>(far & -settled[i]);
  }
  Deviations out{0, 0};
  for (int i = 0; i < n; ++i) out.sum += off[i];
  for (int i = 0; i < n; ++i) out.count += settled[i];
  return out;
}

// Updates the mean of each of n samples (64, 128 or 256). hidden: -1 (skipped) or 0. Sets the new counts. Returns the
// absolute deviations of settled samples, in units.
HUETRACK_CLONES Deviations update(const std::int16_t* seen, const std::int16_t* hidden, int gate, int n,
                                  std::int16_t* mean, const std::uint8_t* counts, std::int16_t* count_now) {
  if (n == 256) return update_of<256>(seen, hidden, gate, mean, counts, count_now);
  if (n == 128) return update_of<128>(seen, hidden, gate, mean, counts, count_now);
  return update_of<64>(seen, hidden, gate, mean, counts, count_now);
}

// The smaller of both.
HUETRACK_CLONES void keep_count(const std::int16_t* __restrict a, const std::int16_t* __restrict b, int n,
                                std::uint8_t* __restrict out) {
  for (int i = 0; i < n; ++i) out[i] = static_cast<std::uint8_t>(a[i] < b[i] ? a[i] : b[i]);
}

// Marks the samples whose centres lie within the discs; one sample is columns x rows pixels.
void hide(const ObjectDisc* discs, std::size_t count, int u0, int v0, int columns, int rows, int across, int down,
          std::int16_t* hidden) {
  std::fill(hidden, hidden + across * down, std::int16_t{0});
  const double slack = 0.5 * std::hypot(columns - 1, rows - 1);
  for (std::size_t k = 0; k < count; ++k) {
    // In samples from the first one's centre.
    const auto reach = static_cast<float>(discs[k].radius_px + slack);
    const float cu = static_cast<float>(discs[k].px.x() - u0) - 0.5f * static_cast<float>(columns - 1);
    const float cv = static_cast<float>(discs[k].px.y() - v0) - 0.5f * static_cast<float>(rows - 1);
    if (!(cu + reach > 0 && cu - reach < size && cv + reach > 0 && cv - reach < size)) continue;
    const float per_column = 1 / static_cast<float>(columns), last = static_cast<float>(across - 1);
    for (int j = 0; j < down; ++j) {
      const float dv = static_cast<float>(j * rows) - cv, left = reach * reach - dv * dv;
      if (!(left > 0)) continue;
      const float half = std::sqrt(left), begin = (cu - half) * per_column, end = (cu + half) * per_column;
      if (end < 0 || begin > last) continue;
      const int from = begin < 0 ? 0 : static_cast<int>(std::ceil(begin));
      const int to = static_cast<int>(end > last ? last : end);
      for (int i = from; i <= to; ++i) hidden[j * across + i] = -1;
    }
  }
}

// The columns that lie less than `beside` px from the segment `way`, on a row `below` px below its start.
std::pair<double, double> columns_beside(const Eigen::Vector2d& way, double below, double beside, double start_u) {
  const double first = (below - beside) / way.y(), last = (below + beside) / way.y();  // shares of the way
  const bool is_level = !(std::isfinite(first) && std::isfinite(last));
  const double from = is_level ? 0 : std::clamp(std::min(first, last), 0.0, 1.0);
  const double to = is_level ? 1 : std::clamp(std::max(first, last), 0.0, 1.0);
  const double u_from = from * way.x(), u_to = to * way.x();
  return {start_u + std::min(u_from, u_to) - beside, start_u + std::max(u_from, u_to) + beside};
}

}  // namespace

Background::Background(int width, int height)
    : width_(width),
      height_(height),
      across_((width + tile_px - 1) / tile_px),
      down_((height + tile_px - 1) / tile_px),
      slots_(static_cast<std::size_t>(across_ * down_), std::int16_t{-1}),
      updates_(slots_.size()) {
  tiles_.reserve(std::min(max_tiles, slots_.size()));
  chosen_.reserve(slots_.size());
  unknown_tiles_ = static_cast<int>(slots_.size());
}

void Background::forget() {
  std::ranges::fill(slots_, std::int16_t{-1});
  std::ranges::fill(updates_, Updates{});
  tiles_.clear();
  unknown_tiles_ = static_cast<int>(slots_.size());
}

void Background::Noise::add(double sum_of_deviations, double of, float min_noise) {
  sum = background_tuning.noise_kept * sum + sum_of_deviations;
  count = background_tuning.noise_kept * count + of;
  if (count > min_noise_samples) noise = std::max(min_noise, static_cast<float>(sum / count / mean_abs_of_normal));
}

Background::Tile& Background::tile_for(int index) {
  std::int16_t& slot = slots_[static_cast<std::size_t>(index)];
  if (slot >= 0) return tiles_[static_cast<std::size_t>(slot)];
  if (tiles_.size() < std::min(max_tiles, slots_.size())) {
    slot = static_cast<std::int16_t>(tiles_.size());
    tiles_.emplace_back();
  } else {
    const auto updates = [&](const Tile& tile) -> Updates& { return updates_[static_cast<std::size_t>(tile.index)]; };
    const auto oldest = std::ranges::min_element(tiles_, {}, [&](const Tile& tile) { return updates(tile).last; });
    slots_[static_cast<std::size_t>(oldest->index)] = -1;
    unknown_tiles_ += updates(*oldest).count >= background_tuning.known_count ? 1 : 0;
    updates(*oldest) = {};
    slot = static_cast<std::int16_t>(oldest - tiles_.begin());
  }
  Tile& tile = tiles_[static_cast<std::size_t>(slot)];
  tile.index = index;
  tile.light_count.fill(0);
  tile.chroma_count.fill(0);
  tile.light.fill(0), tile.blue.fill(0), tile.red.fill(0);
  return tile;
}

// Forgets everything when pictures begin to share chroma in another way.
bool Background::accepts(const Picture& picture) {
  if (picture.width != width_ || picture.height != height_) return false;
  if (picture.columns != columns_ || picture.rows != rows_) {
    forget();
    columns_ = picture.columns, rows_ = picture.rows;
  }
  return true;
}

void Background::learn_all(const Picture& picture, const ObjectDisc* hidden, std::size_t hidden_count) {
  if (!accepts(picture)) return;
  ++pictures_;
  const std::size_t count = std::min(slots_.size(), max_tiles);  // capacity; another part each time
  for (std::size_t i = 0; i < count; ++i) {
    next_ = (next_ + 1) % static_cast<int>(slots_.size());
    update_tile(picture, next_, hidden, hidden_count);
  }
}

void Background::learn(const Picture& picture, const ObjectDisc& object, const Eigen::Vector2d& ahead_px,
                       const ObjectDisc* hidden, std::size_t hidden_count) {
  if (!accepts(picture)) return;
  ++pictures_;
  const double reach = object.radius_px + margin_px;
  const auto tile_of = [](double px, int count) {
    return std::clamp(static_cast<int>(std::floor(std::clamp(px, -1e6, 1e6) / tile_px)), 0, count - 1);
  };
  const int u_min = tile_of(object.px.x() + std::min(0.0, ahead_px.x()) - reach, across_);
  const int u_max = tile_of(object.px.x() + std::max(0.0, ahead_px.x()) + reach, across_);
  const int v_min = tile_of(object.px.y() + std::min(0.0, ahead_px.y()) - reach, down_);
  const int v_max = tile_of(object.px.y() + std::max(0.0, ahead_px.y()) + reach, down_);
  const double way = ahead_px.norm(), beside = reach + tile_reach_px;
  chosen_.clear();
  for (int v = v_min; v <= v_max; ++v) {
    const double off_v = tile_px * (v + 0.5) - object.px.y();
    const auto [u_first, u_last] = columns_beside(ahead_px, off_v, beside, object.px.x());
    for (int u = std::max(u_min, tile_of(u_first, across_)); u <= std::min(u_max, tile_of(u_last, across_)); ++u) {
      const Eigen::Vector2d off(tile_px * (u + 0.5) - object.px.x(), off_v);
      const double along = way > 0 ? std::clamp(off.dot(ahead_px) / (way * way), 0.0, 1.0) : 0.0;
      if ((off - along * ahead_px).norm() > beside) continue;
      if (tile_px * u >= picture.end_u() || tile_px * (u + 1) <= picture.part_u || tile_px * v >= picture.end_v() ||
          tile_px * (v + 1) <= picture.part_v)
        continue;
      const int index = v * across_ + u;
      const Updates& updates = updates_[static_cast<std::size_t>(index)];
      const std::uint64_t count = std::min<std::uint64_t>(updates.count, tile_samples);
      // Fewest updates first, and among these the tile that the object reaches first.
      const auto when = static_cast<std::uint64_t>(255 * along);
      const bool is_known = count >= static_cast<std::uint64_t>(background_noise.max_count);
      chosen_.push_back({index, is_known ? (std::uint64_t{1} << 60) + updates.last : (count / 2 << 8) + when});
    }
  }
  const auto is_hardly_known = [&](int index) {
    return updates_[static_cast<std::size_t>(index)].count < background_tuning.known_count;
  };
  const auto hardly_known = std::ranges::count_if(chosen_, is_hardly_known, &Chosen::index);
  const int by_size =
      std::clamp(static_cast<int>(object.radius_px * object.radius_px / background_tuning.disc_px2_per_tile),
                 background_tuning.min_tiles, background_tuning.max_tiles);
  const auto count = std::min(
      chosen_.size(), static_cast<std::size_t>(std::max<std::ptrdiff_t>(
                          by_size, std::min<std::ptrdiff_t>(hardly_known, background_tuning.hardly_known_tiles))));
  std::ranges::partial_sort(chosen_, chosen_.begin() + static_cast<std::ptrdiff_t>(count), {},
                            [](const Chosen& c) { return std::pair(c.rank, c.index); });
  for (std::size_t i = 0; i < count; ++i) update_tile(picture, chosen_[i].index, hidden, hidden_count);
  if (slots_.size() > max_tiles || !picture.is_whole()) return;
  // The others in turn; while some are hardly known, only these.
  int left = unknown_tiles_ > 0 ? 1 + static_cast<int>(slots_.size()) / background_tuning.pictures_to_see_all : 1;
  for (std::size_t i = 0; i < slots_.size() && left > 0; ++i) {
    next_ = (next_ + 1) % static_cast<int>(slots_.size());
    if (unknown_tiles_ > 0 && !is_hardly_known(next_)) continue;
    --left;
    update_tile(picture, next_, hidden, hidden_count);
  }
}

void Background::update_tile(const Picture& picture, int index, const ObjectDisc* hidden, std::size_t hidden_count) {
  Updates& updates = updates_[static_cast<std::size_t>(index)];
  if (updates.last == pictures_) return;
  Tile& tile = tile_for(index);
  updates.last = pictures_;
  if (++updates.count == background_tuning.known_count) --unknown_tiles_;
  const int u0 = index % across_ * tile_px, v0 = index / across_ * tile_px;
  alignas(64) std::int16_t seen[tile_samples], red[tile_samples], mask[tile_samples], counts[tile_samples];
  // Masks what lies outside the picture, or outside the part of it that is there.
  const auto read_tile = [&](int columns, int rows, auto&& read) {
    const int across = tile_px / columns, down = tile_px / rows;
    hide(hidden, hidden_count, u0, v0, columns, rows, across, down, mask);
    const auto samples_to = [](int px, int shared) { return (px + shared - 1) / shared; };
    const int first = std::max(0, (picture.part_u - u0) / columns), top = std::max(0, (picture.part_v - v0) / rows);
    const int end = std::min(across, samples_to(picture.end_u(), columns) - u0 / columns);
    const int bottom = std::min(down, samples_to(picture.end_v(), rows) - v0 / rows);
    const bool is_all = first == 0 && top == 0 && end == across && bottom == down;
    if (!is_all) {
      std::fill_n(seen, across * down, std::int16_t{0}), std::fill_n(red, across * down, std::int16_t{0});
      for (int k = 0; k < across * down; ++k) {
        const int i = k % across, j = k / across;
        if (i < first || i >= end || j < top || j >= bottom) mask[k] = -1;
      }
    }
    if (first < end && top < bottom)
      read(Rows{u0 / columns + first, v0 / rows + top, end - first, bottom - top, across}, top * across + first);
    return across * down;
  };
  const auto gate = [](const Noise& noise) {
    return static_cast<int>(std::max(background_tuning.min_gate, background_tuning.gate_sigmas * noise.noise) * units);
  };
  const auto add = [](Noise& to, const Deviations& of, float min_noise) {
    to.add(static_cast<double>(of.sum) / units, static_cast<double>(of.count), min_noise);
  };
  int n = read_tile(1, 1, [&](const Rows& rows, int at) { read_light(picture, rows, seen + at); });
  add(light_, update(seen, mask, gate(light_), n, tile.light.data(), tile.light_count.data(), counts),
      background_tuning.min_light_noise);
  keep_count(counts, counts, n, tile.light_count.data());
  if (picture.is_grey) return;
  n = read_tile(columns_, rows_, [&](const Rows& rows, int at) { read_chroma(picture, rows, seen + at, red + at); });
  const int chroma_gate = gate(chroma_);
  alignas(64) std::int16_t counts_of_red[tile_samples];
  add(chroma_, update(seen, mask, chroma_gate, n, tile.blue.data(), tile.chroma_count.data(), counts),
      background_tuning.min_chroma_noise);
  add(chroma_, update(red, mask, chroma_gate, n, tile.red.data(), tile.chroma_count.data(), counts_of_red),
      background_tuning.min_chroma_noise);
  keep_count(counts, counts_of_red, n, tile.chroma_count.data());
}

namespace {

// Stored values of some places.
constexpr int at_once = 64;  // layout
struct Kept {
  alignas(64) std::int16_t light[at_once], blue[at_once], red[at_once];
  alignas(64) std::uint8_t light_count[at_once], chroma_count[at_once];
};
HUETRACK_CLONES void to_values(const Kept& kept, int n, const Background::Values& out) {
  float* __restrict light = out.light, * __restrict blue = out.blue, * __restrict red = out.red;
  float* __restrict light_count = out.light_count, * __restrict chroma_count = out.chroma_count;
  for (int i = 0; i < n; ++i) {
    light[i] = static_cast<float>(kept.light[i]) * (1.f / units);
    blue[i] = static_cast<float>(kept.blue[i]) * (1.f / units);
    red[i] = static_cast<float>(kept.red[i]) * (1.f / units);
    light_count[i] = static_cast<float>(kept.light_count[i]);
    chroma_count[i] = static_cast<float>(kept.chroma_count[i]);
  }
}

// take: reads the stored values of the i-th place.
template <typename Take>
inline __attribute__((always_inline)) void some_at_once(const Places& at, const Background::Values& out, Take&& take) {
  Kept kept;
  for (int from = 0; from < at.n; from += at_once) {
    const int n = std::min(at_once, at.n - from);
    const int *u = at.u + from, *v = at.v + from;
    for (int i = 0; i < n; ++i) take(static_cast<unsigned>(u[i]), static_cast<unsigned>(v[i]), i, kept);
    to_values(kept, n,
              {out.light + from, out.blue + from, out.red + from, out.light_count + from, out.chroma_count + from});
  }
}

// A tile has 8 or 16 samples a row: the power of two.
unsigned power_of(int shared) {
  return shared == 2 ? 3 : 4;
}

}  // namespace

void Background::light(const Places& at, float* light, float* count) const {
  const TileMap tiles = all_tiles();
  for (int i = 0; i < at.n; ++i) {
    const auto u = static_cast<unsigned>(at.u[i]), v = static_cast<unsigned>(at.v[i]);
    const Tile& tile = tiles(u / tile_px, v / tile_px);
    const std::size_t k = v % tile_px * tile_px + u % tile_px;
    light[i] = static_cast<float>(tile.light[k]) * (1.f / units);
    count[i] = static_cast<float>(tile.light_count[k]);
  }
}

void Background::at_pixels(const Picture& picture, const Places& at, const Values& out) const {
  const TileMap tiles = tiles_of(picture);
  const unsigned across = power_of(picture.columns), columns = 4 - across, rows = 4 - power_of(picture.rows);
  some_at_once(
      at, out, [=](unsigned u, unsigned v, int i, Kept& kept) __attribute__((always_inline)) {
        const Tile& tile = tiles(u / tile_px, v / tile_px);
        const unsigned in_u = u % tile_px, in_v = v % tile_px, k = in_v * tile_px + in_u;
        const unsigned sample = ((in_v >> rows) << across) + (in_u >> columns);
        kept.light[i] = tile.light[k], kept.light_count[i] = tile.light_count[k];
        kept.blue[i] = tile.blue[sample], kept.red[i] = tile.red[sample];
        kept.chroma_count[i] = tile.chroma_count[sample];
      });
}

void Background::at_chroma(const Picture& picture, const Places& at, const Values& out) const {
  const TileMap tiles = tiles_of(picture);
  const unsigned across = power_of(picture.columns), down = power_of(picture.rows);
  const unsigned columns = 4 - across, rows = 4 - down;
  // Its one, two or four pixels, each repeated to make four.
  const unsigned right = columns, below = rows * tile_px;
  some_at_once(
      at, out, [=](unsigned u, unsigned v, int i, Kept& kept) __attribute__((always_inline)) {
        const Tile& tile = tiles(u >> across, v >> down);
        const unsigned in_u = u & ((1u << across) - 1), in_v = v & ((1u << down) - 1);
        const unsigned sample = (in_v << across) + in_u;
        const unsigned first = ((in_v << rows) * tile_px) + (in_u << columns);
        const int sum = tile.light[first] + tile.light[first + right] + tile.light[first + below] +
                        tile.light[first + right + below];
        const std::uint8_t above_count = std::min(tile.light_count[first], tile.light_count[first + right]);
        const std::uint8_t below_count =
            std::min(tile.light_count[first + below], tile.light_count[first + right + below]);
        kept.light[i] = static_cast<std::int16_t>(sum >> 2), kept.light_count[i] = std::min(above_count, below_count);
        kept.blue[i] = tile.blue[sample], kept.red[i] = tile.red[sample];
        kept.chroma_count[i] = tile.chroma_count[sample];
      });
}

}  // namespace huetrack::outline
