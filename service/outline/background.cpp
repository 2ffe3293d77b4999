#include "outline/background.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "particle_filter/vector_clones.h"

namespace huetrack::outline {
namespace {

constexpr int most_looks = 16;  // then the mean forgets: half a second of light that changes, or as much as noise asks
// What is seen is what was seen before, if it is no further off than noise may be; what is off again and again uses up
// the looks of what was there.
constexpr float usual_sigmas = 5, least_usual = 8;
constexpr int forgotten_per_look = 2;
constexpr float least_light_noise = 0.7f, least_chroma_noise = 0.5f;
constexpr double noise_kept = 0.98;  // of what was seen of the noise, from look to look
constexpr int settled_looks = 8;
constexpr int margin_px = 8;                 // around the object, of what is learnt first
constexpr int rare_pictures_each = 4;        // of which one tells a tile that is well known
constexpr std::uint32_t looks_at_start = 4;  // a tile with fewer is hardly known
// Per picture: of those that the object is about to reach, and more while some of them are hardly known; beside these
// of the whole picture, so that in a second it was seen once, until none is hardly known.
constexpr int least_tiles = 2, largest_tiles = 5, tiles_hardly_known = 16;
constexpr int pictures_to_see_all = 30;

constexpr int size = Background::tile_px;
constexpr int most_samples = size * size;

struct Off {
  std::int32_t sum, count;
};
template <int n>
inline __attribute__((always_inline)) Off step_of(const std::int16_t* __restrict seen,
                                                  const std::int16_t* __restrict hidden, int usual,
                                                  std::int16_t* __restrict mean, const std::uint8_t* __restrict looks,
                                                  std::int16_t* __restrict looks_now) {
  // By what a mean of so many looks, this one among them, goes on towards it, in 2^15ths; of two or more.
  alignas(64) std::int16_t share[n], off[n], settled[n];
  alignas(64) std::int32_t whole[n];
  std::uint8_t fewest = most_looks;
  for (int i = 0; i < n; ++i) fewest = looks[i] < fewest ? looks[i] : fewest;
  if (fewest + 1 >= most_looks) {  // of a place that is known
    for (int i = 0; i < n; ++i) share[i] = 32768 / most_looks;
  } else {
    for (int i = 0; i < n; ++i) whole[i] = looks[i];
    for (int i = 0; i < n; ++i) {
      const int more = whole[i] + 1 < most_looks ? whole[i] + 1 : most_looks;
      whole[i] = static_cast<std::int32_t>(32768 / static_cast<float>(more < 2 ? 2 : more));
    }
    for (int i = 0; i < n; ++i) share[i] = static_cast<std::int16_t>(whole[i]);
  }
  // Numbers of one kind, and all bits of one that is true, as compilers make vectors of these.
  using Number = std::int16_t;
  const auto near = static_cast<Number>(usual < 32767 ? usual : 32767);
  for (int i = 0; i < n; ++i) looks_now[i] = looks[i];
  for (int i = 0; i < n; ++i) {
    const Number before = mean[i], of = looks_now[i], is_hidden = hidden[i];
    const auto by = static_cast<Number>(seen[i] - before);
    const auto far = static_cast<Number>(by < 0 ? -by : by);
    const Number is_near = far < near ? -1 : 0, is_known = of > 0 ? -1 : 0;
    const auto is_same = static_cast<Number>(is_near & is_known);
    const auto more = static_cast<Number>(of + 1 < most_looks ? of + 1 : most_looks);
    const auto fewer = static_cast<Number>(of - forgotten_per_look);
    const Number is_gone = fewer <= 0 ? -1 : 0;
    const auto is_new = static_cast<Number>(~is_same & is_gone);
    const auto part = static_cast<Number>(((by * share[i] >> 14) + 1) >> 1);
    const auto moved = static_cast<Number>(((part & is_same) | (by & is_new)) & ~is_hidden);
    const auto then = static_cast<Number>((more & is_same) | (is_new & 1) | (fewer & ~is_same & ~is_new));
    mean[i] = static_cast<Number>(before + moved);
    looks_now[i] = static_cast<Number>((then & ~is_hidden) | (of & is_hidden));
    const Number is_settled = of >= settled_looks ? -1 : 0;
    settled[i] = static_cast<Number>(is_settled & is_same & ~is_hidden & 1);
    off[i] = static_cast<Number>(far & -settled[i]);
  }
  Off out{0, 0};
  for (int i = 0; i < n; ++i) out.sum += off[i];
  for (int i = 0; i < n; ++i) out.count += settled[i];
  return out;
}

// One step of the mean of each sample. hidden: -1: not looked at; 0. n: of a tile, 64, 128 or 256. Sets how many looks
// there are then. Returns how far settled samples were off, in units, and how many there were.
HUETRACK_CLONES Off step(const std::int16_t* seen, const std::int16_t* hidden, int usual, int n, std::int16_t* mean,
                         const std::uint8_t* looks, std::int16_t* looks_now) {
  if (n == 256) return step_of<256>(seen, hidden, usual, mean, looks, looks_now);
  if (n == 128) return step_of<128>(seen, hidden, usual, mean, looks, looks_now);
  return step_of<64>(seen, hidden, usual, mean, looks, looks_now);
}

// The fewer of both, where there are two.
HUETRACK_CLONES void keep_looks(const std::int16_t* __restrict a, const std::int16_t* __restrict b, int n,
                                std::uint8_t* __restrict out) {
  for (int i = 0; i < n; ++i) out[i] = static_cast<std::uint8_t>(a[i] < b[i] ? a[i] : b[i]);
}

// Samples whose centres lie within the discs; one sample is columns x rows pixels.
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

// From which column to which one something may lie less than `beside` px from the way, so far below its start.
std::pair<double, double> columns_beside(const Eigen::Vector2d& way, double below, double beside, double start_u) {
  const double first = (below - beside) / way.y(), last = (below + beside) / way.y();  // shares of the way
  const bool is_level = !(std::isfinite(first) && std::isfinite(last));
  const double from = is_level ? 0 : std::clamp(std::min(first, last), 0.0, 1.0);
  const double to = is_level ? 1 : std::clamp(std::max(first, last), 0.0, 1.0);
  const double u_from = from * way.x(), u_to = to * way.x();
  return {start_u + std::min(u_from, u_to) - beside, start_u + std::max(u_from, u_to) + beside};
}

}  // namespace

Background::Background(int width, int height, std::size_t tiles)
    : width_(width),
      height_(height),
      across_((width + tile_px - 1) / tile_px),
      down_((height + tile_px - 1) / tile_px),
      tiles_kept_(tiles),
      slots_(static_cast<std::size_t>(across_ * down_), std::int16_t{-1}),
      looked_(slots_.size()) {
  tiles_.reserve(std::min(tiles_kept_, slots_.size()));
  chosen_.reserve(slots_.size());
  unknown_tiles_ = static_cast<int>(slots_.size());
}

void Background::forget() {
  std::ranges::fill(slots_, std::int16_t{-1});
  std::ranges::fill(looked_, Looked{});
  tiles_.clear();
  unknown_tiles_ = static_cast<int>(slots_.size());
}

void Background::Noise::add(double sum_of_off, double of, float least) {
  sum = noise_kept * sum + sum_of_off;
  count = noise_kept * count + of;
  // Half of the normal distribution is nearer than 0.67, its mean 0.80 standard deviations.
  if (count > 500) noise = std::max(least, static_cast<float>(sum / count / 0.798));
}

Background::Tile& Background::tile_for(int index) {
  std::int16_t& slot = slots_[static_cast<std::size_t>(index)];
  if (slot >= 0) return tiles_[static_cast<std::size_t>(slot)];
  if (tiles_.size() < std::min(tiles_kept_, slots_.size())) {
    slot = static_cast<std::int16_t>(tiles_.size());
    tiles_.emplace_back();
  } else {
    const auto looked = [&](const Tile& tile) -> Looked& { return looked_[static_cast<std::size_t>(tile.index)]; };
    const auto oldest = std::ranges::min_element(tiles_, {}, [&](const Tile& tile) { return looked(tile).at; });
    slots_[static_cast<std::size_t>(oldest->index)] = -1;
    unknown_tiles_ += looked(*oldest).looks >= looks_at_start ? 1 : 0;
    looked(*oldest) = {};
    slot = static_cast<std::int16_t>(oldest - tiles_.begin());
  }
  Tile& tile = tiles_[static_cast<std::size_t>(slot)];
  tile.index = index;
  tile.light_looks.fill(0);
  tile.chroma_looks.fill(0);
  tile.light.fill(0), tile.blue.fill(0), tile.red.fill(0);
  return tile;
}

// What was learnt of pictures that share chroma otherwise says nothing of this one.
bool Background::is_such(const Picture& picture) {
  if (picture.width != width_ || picture.height != height_) return false;
  if (picture.columns != columns_ || picture.rows != rows_) {
    forget();
    columns_ = picture.columns, rows_ = picture.rows;
  }
  return true;
}

void Background::learn_all(const Picture& picture, const ObjectDisc* hidden, std::size_t hidden_count) {
  if (!is_such(picture)) return;
  ++pictures_;
  ++rare_pictures_;
  const std::size_t count = std::min(slots_.size(), tiles_kept_);  // more are not kept: another part each time
  for (std::size_t i = 0; i < count; ++i) {
    next_ = (next_ + 1) % static_cast<int>(slots_.size());
    const bool is_known = looked_[static_cast<std::size_t>(next_)].looks >= static_cast<std::uint32_t>(settled_looks);
    // Of rows, as neighbours share what the processor fetches at once.
    const bool is_its_turn = next_ / across_ % rare_pictures_each == rare_pictures_ % rare_pictures_each;
    if (!is_known || is_its_turn) look(picture, next_, hidden, hidden_count);
  }
}

void Background::learn(const Picture& picture, const ObjectDisc& object, const Eigen::Vector2d& ahead_px,
                       const ObjectDisc* hidden, std::size_t hidden_count) {
  if (!is_such(picture)) return;
  ++pictures_;
  const double reach = object.radius_px + margin_px;
  const auto tile_of = [](double px, int count) {
    return std::clamp(static_cast<int>(std::floor(std::clamp(px, -1e6, 1e6) / tile_px)), 0, count - 1);
  };
  const int u_min = tile_of(object.px.x() + std::min(0.0, ahead_px.x()) - reach, across_);
  const int u_max = tile_of(object.px.x() + std::max(0.0, ahead_px.x()) + reach, across_);
  const int v_min = tile_of(object.px.y() + std::min(0.0, ahead_px.y()) - reach, down_);
  const int v_max = tile_of(object.px.y() + std::max(0.0, ahead_px.y()) + reach, down_);
  // Of those that the way crosses.
  const double way = ahead_px.norm(), beside = reach + 0.7 * tile_px;
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
      const Looked& looked = looked_[static_cast<std::size_t>(index)];
      const std::uint64_t looks = std::min<std::uint64_t>(looked.looks, most_samples);
      // The ones with the fewest looks, and of these the ones that are reached first.
      const auto when = static_cast<std::uint64_t>(255 * along);
      const bool is_known = looks >= static_cast<std::uint64_t>(most_looks);
      chosen_.push_back({index, is_known ? (std::uint64_t{1} << 60) + looked.at : (looks / 2 << 8) + when});
    }
  }
  const auto is_hardly_known = [&](int index) {
    return looked_[static_cast<std::size_t>(index)].looks < looks_at_start;
  };
  const auto hardly_known = std::ranges::count_if(chosen_, is_hardly_known, &Chosen::index);
  const int usual = std::clamp(static_cast<int>(object.radius_px * object.radius_px / 32), least_tiles, largest_tiles);
  const auto count = std::min(chosen_.size(), static_cast<std::size_t>(std::max<std::ptrdiff_t>(
                                                  usual, std::min<std::ptrdiff_t>(hardly_known, tiles_hardly_known))));
  std::ranges::partial_sort(chosen_, chosen_.begin() + static_cast<std::ptrdiff_t>(count), {},
                            [](const Chosen& c) { return std::pair(c.rank, c.index); });
  for (std::size_t i = 0; i < count; ++i) look(picture, chosen_[i].index, hidden, hidden_count);
  if (slots_.size() > tiles_kept_ || !picture.is_whole()) return;
  // The others in turn: while some are hardly known only these.
  int left = unknown_tiles_ > 0 ? 1 + static_cast<int>(slots_.size()) / pictures_to_see_all : 1;
  for (std::size_t i = 0; i < slots_.size() && left > 0; ++i) {
    next_ = (next_ + 1) % static_cast<int>(slots_.size());
    if (unknown_tiles_ > 0 && !is_hardly_known(next_)) continue;
    --left;
    look(picture, next_, hidden, hidden_count);
  }
}

void Background::look(const Picture& picture, int index, const ObjectDisc* hidden, std::size_t hidden_count) {
  Looked& looked = looked_[static_cast<std::size_t>(index)];
  if (looked.at == pictures_) return;
  Tile& tile = tile_for(index);
  looked.at = pictures_;
  if (++looked.looks == looks_at_start) --unknown_tiles_;
  const int u0 = index % across_ * tile_px, v0 = index / across_ * tile_px;
  alignas(64) std::int16_t seen[most_samples], red[most_samples], mask[most_samples], looks[most_samples];
  // Beyond the picture, or the part of it that is there, nothing is seen.
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
  const auto usual = [](const Noise& noise) {
    return static_cast<int>(std::max(least_usual, usual_sigmas * noise.noise) * units);
  };
  const auto add = [](Noise& to, const Off& off, float least) {
    to.add(static_cast<double>(off.sum) / units, static_cast<double>(off.count), least);
  };
  int n = read_tile(1, 1, [&](const Rows& rows, int at) { read_light(picture, rows, seen + at); });
  add(light_, step(seen, mask, usual(light_), n, tile.light.data(), tile.light_looks.data(), looks), least_light_noise);
  keep_looks(looks, looks, n, tile.light_looks.data());
  if (picture.is_grey) return;
  n = read_tile(columns_, rows_, [&](const Rows& rows, int at) { read_chroma(picture, rows, seen + at, red + at); });
  const int usual_chroma = usual(chroma_);
  alignas(64) std::int16_t looks_of_red[most_samples];
  add(chroma_, step(seen, mask, usual_chroma, n, tile.blue.data(), tile.chroma_looks.data(), looks),
      least_chroma_noise);
  add(chroma_, step(red, mask, usual_chroma, n, tile.red.data(), tile.chroma_looks.data(), looks_of_red),
      least_chroma_noise);
  keep_looks(looks, looks_of_red, n, tile.chroma_looks.data());
}

namespace {

// As they are kept, of some places.
constexpr int at_once = 64;
struct Kept {
  alignas(64) std::int16_t light[at_once], blue[at_once], red[at_once];
  alignas(64) std::uint8_t light_looks[at_once], chroma_looks[at_once];
};
HUETRACK_CLONES void to_values(const Kept& kept, int n, const Background::Values& out) {
  float* __restrict light = out.light, * __restrict blue = out.blue, * __restrict red = out.red;
  float* __restrict light_looks = out.light_looks, * __restrict chroma_looks = out.chroma_looks;
  for (int i = 0; i < n; ++i) {
    light[i] = static_cast<float>(kept.light[i]) * (1.f / units);
    blue[i] = static_cast<float>(kept.blue[i]) * (1.f / units);
    red[i] = static_cast<float>(kept.red[i]) * (1.f / units);
    light_looks[i] = static_cast<float>(kept.light_looks[i]);
    chroma_looks[i] = static_cast<float>(kept.chroma_looks[i]);
  }
}

// take: what is kept of the i-th place.
template <typename Take>
inline __attribute__((always_inline)) void some_at_once(const Places& at, const Background::Values& out, Take&& take) {
  Kept kept;
  for (int from = 0; from < at.n; from += at_once) {
    const int n = std::min(at_once, at.n - from);
    const int *u = at.u + from, *v = at.v + from;
    for (int i = 0; i < n; ++i) take(static_cast<unsigned>(u[i]), static_cast<unsigned>(v[i]), i, kept);
    to_values(kept, n,
              {out.light + from, out.blue + from, out.red + from, out.light_looks + from, out.chroma_looks + from});
  }
}

// Of 16 pixels 8 or 16 samples: the power of two.
unsigned power_of(int shared) {
  return shared == 2 ? 3 : 4;
}

}  // namespace

void Background::light(const Places& at, float* light, float* looks) const {
  for (int i = 0; i < at.n; ++i) {
    const auto u = static_cast<unsigned>(at.u[i]), v = static_cast<unsigned>(at.v[i]);
    const Tile& tile = known_at(u / tile_px, v / tile_px);
    const std::size_t k = v % tile_px * tile_px + u % tile_px;
    light[i] = static_cast<float>(tile.light[k]) * (1.f / units);
    looks[i] = static_cast<float>(tile.light_looks[k]);
  }
}

void Background::at_pixels(const Picture& picture, const Places& at, const Values& out) const {
  const Known known = known_of(picture);
  const unsigned across = power_of(picture.columns), columns = 4 - across, rows = 4 - power_of(picture.rows);
  some_at_once(
      at, out, [=](unsigned u, unsigned v, int i, Kept& kept) __attribute__((always_inline)) {
        const Tile& tile = known(u / tile_px, v / tile_px);
        const unsigned in_u = u % tile_px, in_v = v % tile_px, k = in_v * tile_px + in_u;
        const unsigned sample = ((in_v >> rows) << across) + (in_u >> columns);
        kept.light[i] = tile.light[k], kept.light_looks[i] = tile.light_looks[k];
        kept.blue[i] = tile.blue[sample], kept.red[i] = tile.red[sample];
        kept.chroma_looks[i] = tile.chroma_looks[sample];
      });
}

void Background::at_chroma(const Picture& picture, const Places& at, const Values& out) const {
  const Known known = known_of(picture);
  const unsigned across = power_of(picture.columns), down = power_of(picture.rows);
  const unsigned columns = 4 - across, rows = 4 - down;
  // Of its one, two or four pixels, each as often as makes it four.
  const unsigned right = columns, below = rows * tile_px;
  some_at_once(
      at, out, [=](unsigned u, unsigned v, int i, Kept& kept) __attribute__((always_inline)) {
        const Tile& tile = known(u >> across, v >> down);
        const unsigned in_u = u & ((1u << across) - 1), in_v = v & ((1u << down) - 1);
        const unsigned sample = (in_v << across) + in_u;
        const unsigned first = ((in_v << rows) * tile_px) + (in_u << columns);
        const int sum = tile.light[first] + tile.light[first + right] + tile.light[first + below] +
                        tile.light[first + right + below];
        const std::uint8_t above_looks = std::min(tile.light_looks[first], tile.light_looks[first + right]);
        const std::uint8_t below_looks =
            std::min(tile.light_looks[first + below], tile.light_looks[first + right + below]);
        kept.light[i] = static_cast<std::int16_t>(sum >> 2), kept.light_looks[i] = std::min(above_looks, below_looks);
        kept.blue[i] = tile.blue[sample], kept.red[i] = tile.red[sample];
        kept.chroma_looks[i] = tile.chroma_looks[sample];
      });
}

}  // namespace huetrack::outline
