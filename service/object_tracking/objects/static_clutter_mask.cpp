#include "object_tracking/objects/static_clutter_mask.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

namespace huetrack::objects {

using namespace object_tracking;

namespace {

struct StaticClutterTuning {
  double share_points = 4800;   // grid points that measure the colour's share of an image
  double surrounded = 0.5;      // share of an object's surroundings of its colour from which it counts as clutter
  int around_points = 24;       // points at which these are sampled
  double min_disc = 0.6;        // area of a disc over the smallest one of an object, and of the largest over its area
  double min_roundness = 0.75;  // of its half widths
  double min_filled = 0.85;     // of the ellipse of these half widths
  std::size_t probes = 64;      // masked pixels by which a view's light is followed: medians to a sixth of sigma
  float min_noise = 1;          // grey values, 1 sigma of a masked pixel's noise
};
constexpr StaticClutterTuning static_clutter{};
// Of an image: 16 grid points, four sigmas of their Poisson noise.
constexpr double min_share = sighting_tuning.gate_nis / static_clutter.share_points;
// Hysteresis: half-way, in logarithms, to what the objects could cover.
const double shared_below = std::sqrt(clutter_history.shared_above);
const float usual_sigmas = static_cast<float>(std::sqrt(sighting_tuning.gate_nis));  // of a masked pixel's noise

constexpr int grid_px = color::TileAt::size;  // layout: a point per tile
constexpr double tile_half_px = 3.5;          // layout: from a tile's first pixel to its centre
constexpr float sigma_of_mad = 1.4826f;       // maths: of a normal distribution
constexpr double tile_reach_px = 6;           // layout: more than from there to its corner
constexpr float brightest = 255;              // unit: of a byte

constexpr std::uint64_t left_column = 0x0101010101010101u, right_column = left_column << 7;  // layout
constexpr std::uint64_t top_row = 0xff, bottom_row = top_row << 56;                          // layout

// Pixels that are set in at least three of four words: a flicker in one of them is ignored.
std::uint64_t mostly(const std::array<std::uint64_t, 4>& words) {
  const auto& [a, b, c, d] = words;
  return (a & b & (c | d)) | (c & d & (a | b));
}

// One pixel more at the sides, and above and below, within a tile.
std::uint64_t widened(std::uint64_t w) {
  return w | (w & ~right_column) << 1 | (w & ~left_column) >> 1;
}
std::uint64_t heightened(std::uint64_t w) {
  return w | w << 8 | w >> 8;
}

color::TileAt tile_at(std::size_t index, int stride) {
  return {static_cast<std::uint16_t>(int(index) % stride), static_cast<std::uint16_t>(int(index) / stride)};
}

double covered_px(double radius_px) {
  return sighting_tuning.covered_radii * radius_px + sighting_tuning.covered_px;
}

// Share of the points on a circle for which of(u, v) holds, of those that are in an image of this size.
double share_of_circle(const Eigen::Vector2d& px, double radius_px, int width, int height, const auto& of) {
  int seen = 0, held = 0;
  for (int i = 0; i < static_clutter.around_points; ++i) {
    const double angle = 2 * std::numbers::pi * i / static_clutter.around_points;
    const double u = px.x() + radius_px * std::cos(angle), v = px.y() + radius_px * std::sin(angle);
    if (!(u >= 0 && v >= 0 && u < width && v < height)) continue;
    ++seen;
    held += of(int(u), int(v)) ? 1 : 0;
  }
  return double(held) / std::max(1, seen);
}

bool is_surrounded(const TargetView& view, const Sighting& s) {
  return share_of_circle(s.px, covered_px(s.radius_px) + 1, view.image->width, view.image->height,
                         [&](int u, int v) { return view.matches->at(u, v); }) > static_clutter.surrounded;
}

}  // namespace

void StaticClutterMask::set_sizes(std::size_t camera, double smallest_px, double largest_px, calib::ImageSize size) {
  cameras_[camera].smallest_px = smallest_px, cameras_[camera].largest_px = largest_px;
  const double area = std::numbers::pi * (largest_px * largest_px + (count_ - 1) * smallest_px * largest_px);
  shares_[camera].of_target = std::min(1.0, area / (size.width * size.height));
}

void StaticClutterMask::forget(std::size_t camera) {
  cameras_[camera] = {};
  shares_[camera].still = 0, shares_[camera].still_box = {};
}

bool StaticClutterMask::may_clip(std::size_t camera, const Eigen::Vector2d& px, double radius_px) const {
  const double reach_px = sighting_tuning.part_radii * radius_px;
  const PerCamera& in = cameras_[camera];
  if (in.listed.empty() || !px.allFinite()) return false;
  const int rows = int(in.tiles.size()) / in.stride;
  const auto tile_of = [](double at, int count) {
    return int(std::clamp(std::floor(at / color::TileAt::size) + 1, 0.0, count - 1.0));
  };
  for (int v = tile_of(px.y() - reach_px, rows); v <= tile_of(px.y() + reach_px, rows); ++v) {
    for (int u = tile_of(px.x() - reach_px, in.stride); u <= tile_of(px.x() + reach_px, in.stride); ++u) {
      std::uint64_t still = in.tiles[std::size_t(v * in.stride + u)].still;
      for (; still != 0; still &= still - 1) {
        const int bit = std::countr_zero(still);
        const Eigen::Vector2d at(color::TileAt::size * (u - 1) + bit % 8, color::TileAt::size * (v - 1) + bit / 8);
        if ((at - px).norm() <= reach_px) return true;
      }
    }
  }
  return false;
}

double StaticClutterMask::uncovered_density(std::size_t camera, const Eigen::Vector2d& px, double radius_px) const {
  const PerCamera& in = cameras_[camera];
  if (in.tiles.empty() || !px.allFinite()) return 0;
  const int columns = in.stride - 2, rows = int(in.tiles.size()) / in.stride - 2;  // without the margin tiles
  const auto share = [&](double reach_px, std::uint64_t Tile::*bits) {
    return share_of_circle(px, reach_px, columns * grid_px, rows * grid_px, [&](int u, int v) {
      const Tile& tile = in.tiles[std::size_t((v / grid_px + 1) * in.stride + u / grid_px + 1)];
      return (tile.*bits >> (v % grid_px * grid_px + u % grid_px) & 1) != 0;
    });
  };
  const double hidden = 1 - share(radius_px / 2, &Tile::seen);
  return hidden == 0 ? 0 : hidden * share(covered_px(radius_px) + 1, &Tile::still) / disc_area(radius_px);
}

void StaticClutterMask::mark_clipped(std::vector<Sighting>& sightings) const {
  if (!is_room_shared_) return;
  for (Sighting& s : sightings) {
    const double radius_px = s.support > 0 ? s.radius_px / std::sqrt(s.support) : s.radius_px;  // of its whole disc
    if (!may_clip(std::size_t(s.row.camera), s.px, radius_px)) continue;
    s.is_cut = true;
    if (s.is_outline) continue;
    s.size.reset();
    const double off_px = sighting_tuning.cut_error * (1 - s.support) * radius_px;
    s.covariance.diagonal().array() += off_px * off_px;
  }
}

void StaticClutterMask::look(const std::vector<TargetView>& views, capture::Timestamp set_at) {
  if (views.empty()) return;
  for (const TargetView& view : views) follow_light(view, cameras_[std::size_t(view.index)]);
  // Each view at its first set; one view decides for all.
  const auto is_first = [&](const TargetView& view) { return cameras_[std::size_t(view.index)].sampled == 0; };
  for (const TargetView& view : views)
    if (is_first(view)) measure(view);
  const bool is_shared = std::ranges::any_of(cameras_, &PerCamera::is_above);
  for (const TargetView& view : views) {
    PerCamera& camera = cameras_[std::size_t(view.index)];
    if (is_first(view) && is_shared) find_what_may_be_objects(view, camera);
    if (is_first(view) || (is_shared && !camera.is_learning)) sample(view, {});
  }
  if (!last_at_) last_at_ = set_at;
}

void StaticClutterMask::learn(const std::vector<TargetView>& views, std::span<const Sighting> tracked,
                              capture::Timestamp set_at) {
  if (views.empty() || last_at_ == set_at) return;
  for (const TargetView& view : views) {  // the first samples in consecutive sets
    const PerCamera& camera = cameras_[std::size_t(view.index)];
    if (camera.is_learning && camera.sampled < samples) sample(view, tracked);
  }
  if (std::abs(capture::seconds(set_at - *last_at_)) < clutter_history.period_s / double(views.size())) return;
  last_at_ = set_at;
  sample(views[next_++ % views.size()], tracked);
}

// Counts the colours that are in the view now, but for those of objects.
void StaticClutterMask::learn_colors(const TargetView& view, PerCamera& camera) {
  if (!view.matches->has_pixels() || view.table == nullptr) return;
  discs_.clear();
  for (const Sighting& s : covering_) discs_.push_back({s.px, covered_px(s.radius_px)});
  if (camera.colors == nullptr) camera.colors = std::make_shared<color::RoomColors>();
  camera.colors->learn(*view.matches, *view.table, view.image->format, discs_, kept_samples);
  view.matches->set_room(camera.colors);
}

// Whole discs of an object's size at the first set.
void StaticClutterMask::find_what_may_be_objects(const TargetView& view, PerCamera& camera) {
  if (camera.largest_px == 0) return;
  const double smallest_disc = disc_area(camera.smallest_px);
  const double largest_disc = disc_area(camera.largest_px);
  const auto add_if_disc = [&](const color::ColorRegion& region) {
    const Eigen::Vector2d half = 2 * Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>()
                                         .computeDirect(region.spread)
                                         .eigenvalues()
                                         .cwiseMax(0)
                                         .cwiseSqrt();  // ascending
    const double filled = region.area / (std::numbers::pi * half.x() * half.y());
    if (region.area < static_clutter.min_disc * smallest_disc || region.area > largest_disc / static_clutter.min_disc ||
        half.x() < static_clutter.min_roundness * half.y() || filled < static_clutter.min_filled)
      return;
    Sighting& s = camera.may_be_objects.emplace_back();
    s.row.camera = view.index;
    s.px = region.centre;
    s.radius_px = disc_radius(region.area);
  };
  const int step = std::max(1, int(std::numbers::sqrt2 * camera.smallest_px));
  const int usual = int(2 * std::sqrt(camera.smallest_px * camera.largest_px)) + 2;
  const int largest = int(4 * camera.largest_px) + 2;
  std::ranges::for_each(
      camera.finder.components(*view.matches, step, {}, usual, largest, int(static_clutter.min_disc * smallest_disc)),
      add_if_disc);
  learn_colors(view, camera);
  if (view.matches->room() != nullptr)
    std::ranges::for_each(camera.disc_finder.find(*view.matches, {0, 0, view.image->width - 1, view.image->height - 1},
                                                  camera.smallest_px, camera.largest_px),
                          add_if_disc);
  view.matches->look_anew();  // classified again, with the mask
}

void StaticClutterMask::measure(const TargetView& view) {
  PerCamera& camera = cameras_[std::size_t(view.index)];
  ColorShare& share = shares_[std::size_t(view.index)];
  // Coarser where only the share is needed.
  const double pixels = double(view.image->width) * view.image->height;
  const int wide_px = int(std::sqrt(pixels / static_clutter.share_points));
  hits_px_ = camera.is_learning ? grid_px : std::max(grid_px, wide_px);
  view.matches->grid_with_left_out(hits_px_, hits_);
  const double probed = std::max(1.0, std::floor((view.image->width + hits_px_ / 2.0) / hits_px_) *
                                          std::floor((view.image->height + hits_px_ / 2.0) / hits_px_));
  share.of_picture = std::min(1.0, double(hits_.size()) / probed);
  const double bound = (camera.is_above ? shared_below : clutter_history.shared_above) * share.of_target;
  camera.is_above = camera.is_crowded || share.of_picture > std::max(min_share, bound);
}

void StaticClutterMask::sample(const TargetView& view, std::span<const Sighting> tracked) {
  measure(view);
  PerCamera& camera = cameras_[std::size_t(view.index)];
  // With several objects, what rests and is not tracked is clutter; a single one may be lost and at rest.
  is_room_shared_ = std::ranges::any_of(cameras_, &PerCamera::is_above);
  const bool is_learning = is_room_shared_ || (count_ > 1 && camera.sampled > 0);
  if (!is_learning && camera.is_learning) {
    view.matches->leave_out_nothing();
    view.matches->set_room(nullptr);
    camera = {.tiles = {}, .listed = {}, .sampled = 1};  // a past without matches
    ColorShare& share = shares_[std::size_t(view.index)];
    share.still = 0, share.still_box = {}, share.still_px.setZero();
    return;
  }
  camera.is_learning = is_learning;
  if (!is_learning) {
    camera.sampled = 1;
    return;
  }
  if (hits_px_ != grid_px) view.matches->grid_with_left_out(grid_px, hits_);
  learn_pixels(view, camera, tracked);
  leave_out(view, camera);
  if (is_room_shared_) learn_colors(view, camera);
}

void StaticClutterMask::learn_pixels(const TargetView& view, PerCamera& camera, std::span<const Sighting> tracked) {
  const int stride = view.matches->tile_stride();
  if (camera.tiles.empty()) {
    camera.tiles.resize(std::size_t(stride * view.matches->tile_rows()));
    camera.stride = stride;
    // A room that shares the colour only now: its past had no matches.
    if (camera.sampled > 0) camera.sampled = kept_samples;
  }
  const auto list = [&](int u, int v) {
    if (u < 1 || v < 1 || u >= stride - 1 || v >= view.matches->tile_rows() - 1) return;
    const auto at = static_cast<std::uint32_t>(v * stride + u);
    if (camera.tiles[at].is_listed) return;
    camera.tiles[at].is_listed = true;
    camera.listed.push_back(at);
  };
  for (const color::PixelAt& hit : hits_) {
    for (int dv = -1; dv <= 1; ++dv)
      for (int du = -1; du <= 1; ++du) list(hit.u / color::TileAt::size + 1 + du, hit.v / color::TileAt::size + 1 + dv);
  }
  const auto place = std::size_t(camera.sampled % kept_samples);
  const auto before = [&](int sets) {  // in the ring; 0: now
    return std::size_t((camera.sampled + kept_samples - sets) % kept_samples);
  };
  cover(view, camera, tracked);
  for (const std::uint32_t at : camera.listed) {
    Tile& tile = camera.tiles[at];
    const color::TileAt where = tile_at(at, stride);
    const std::uint64_t covered = covered_in(where);
    const std::uint64_t matched = view.matches->tile_with_left_out(where);
    tile.matched[place] = (matched & ~covered) | (tile.still & covered);
  }
  std::erase_if(camera.listed, [&](std::uint32_t at) {
    Tile& tile = camera.tiles[at];
    std::array<std::uint64_t, samples> last;
    for (int i = 0; i < samples; ++i) last[std::size_t(i)] = tile.matched[before(i)];
    std::uint64_t matched = 0, gone = 0, again = 0;
    for (int i = kept_samples - 1; i >= 0; --i) {  // from the oldest one on
      const std::uint64_t now = tile.matched[before(i)];
      again |= gone & now;
      matched |= now;
      gone |= matched & ~now;
    }
    const std::uint64_t ever = last[0] | last[1] | last[2] | last[3];
    // A static pixel stays so while it matches at all: at edges noise decides. After the first samples, a pixel that
    // has not matched before shows something that moves, or will match again.
    if (camera.sampled < samples)
      tile.still = matched;
    else
      tile.still = (tile.still & ever) | mostly(last) | (is_room_shared_ ? again : 0);
    tile.is_listed = matched != 0;
    return !tile.is_listed;
  });
  if (++camera.sampled == samples) camera.may_be_objects.clear();
}

// An object hides the room behind it, whether or not the object itself is learnt as clutter (is_surrounded()).
void StaticClutterMask::cover(const TargetView& view, PerCamera& camera, std::span<const Sighting> tracked) {
  covering_.assign(camera.may_be_objects.begin(), camera.may_be_objects.end());
  const std::size_t first_tracked = covering_.size();
  for (const Sighting& s : tracked)
    if (s.row.camera == view.index) covering_.push_back(s);
  for (std::size_t at = 0; at < camera.tiles.size(); ++at)
    camera.tiles[at].seen |= ~covered_in(tile_at(at, camera.stride));
  const auto surrounded = std::ranges::remove_if(covering_.begin() + std::ptrdiff_t(first_tracked), covering_.end(),
                                                 [&](const Sighting& s) { return is_surrounded(view, s); });
  covering_.erase(surrounded.begin(), surrounded.end());
}

std::uint64_t StaticClutterMask::covered_in(color::TileAt tile) const {
  std::uint64_t covered = 0;
  for (const Sighting& s : covering_) {
    const double reach = covered_px(s.radius_px);
    const double du = tile.pixel_u() + tile_half_px - s.px.x(), dv = tile.pixel_v() + tile_half_px - s.px.y();
    if (std::hypot(du, dv) > reach + tile_reach_px) continue;
    for (int bit = 0; bit < 64; ++bit) {
      const int column = bit % 8, row = bit / 8;
      const double u = tile.pixel_u() + column - s.px.x(), v = tile.pixel_v() + row - s.px.y();
      if (u * u + v * v < reach * reach) covered |= std::uint64_t{1} << bit;
    }
  }
  return covered;
}

// Values of the masked pixels in this sample's light. Under an object nothing new is learnt. A pixel that matches the
// colour and differs in three samples one after the other has changed for good.
void StaticClutterMask::learn_usual(const TargetView& view, const PerCamera& camera, color::TileAt where,
                                    std::uint64_t masked, Tile& tile) {
  const std::uint64_t covered = covered_in(where), matched = view.matches->tile_with_left_out(where);
  const std::uint64_t before = tile.known;
  std::uint64_t differs = 0;
  tile.known &= masked;
  for (std::uint64_t left = masked; left != 0; left &= left - 1) {
    const int bit = std::countr_zero(left);
    const std::uint64_t here = std::uint64_t{1} << bit;
    const int u = where.pixel_u() + bit % 8, v = where.pixel_v() + bit / 8;
    if (u < 0 || v < 0 || u >= view.image->width || v >= view.image->height) continue;
    const auto now = view.matches->values_at(u, v);
    std::array<std::uint8_t, 3>& usual = tile.usual[std::size_t(bit)];
    const bool is_known = (before & here) != 0, is_covered = (covered & here) != 0;
    if (!is_known && is_covered) continue;
    tile.known |= here;
    const auto expected = color::expected_values(camera.light, usual, view.image->format);
    const bool is_as_usual = is_known && color::shows(camera.light, expected, now);
    if (is_known && !is_as_usual && (matched & ~covered & here) != 0) differs |= here;
    const bool is_new = !is_known || (differs & tile.changed[0] & tile.changed[1] & here) != 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const float mean = is_as_usual && !is_covered ? (3 * expected[c] + float(now[c])) / 4 : expected[c];
      usual[c] = is_new ? now[c] : static_cast<std::uint8_t>(std::lround(std::clamp(mean, 0.f, brightest)));
    }
  }
  tile.changed = {differs, tile.changed[0]};
}

// Medians over masked pixels, most of which show what they usually show.
void StaticClutterMask::follow_light(const TargetView& view, PerCamera& camera) {
  if (camera.probes.empty() || !view.matches->has_pixels()) return;
  const auto median = [&] {
    const auto middle = differences_.begin() + std::ptrdiff_t(differences_.size() / 2);
    std::ranges::nth_element(differences_, middle);
    return *middle;
  };
  color::LightChange& light = camera.light;
  light = {};
  differences_.clear();
  for (const Probe& probe : camera.probes)
    differences_.push_back(float(view.matches->values_at(probe.u, probe.v)[0]) /
                           float(std::max<int>(1, (*probe.usual)[0])));
  light.gain = median();
  for (std::size_t c = 0; c < 3; ++c) {
    differences_.clear();
    for (const Probe& probe : camera.probes)
      differences_.push_back(float(view.matches->values_at(probe.u, probe.v)[c]) -
                             color::expected_values(light, *probe.usual, view.image->format)[c]);
    const float shift = median();
    for (float& d : differences_) d = std::abs(d - shift);
    light.shift[c] = shift;
    light.gate[c] = usual_sigmas * std::max(static_clutter.min_noise, sigma_of_mad * median());
  }
  view.matches->set_light(light);
}

// Dilated by a pixel: at edges noise decides.
void StaticClutterMask::leave_out(const TargetView& view, PerCamera& camera) {
  const int stride = view.matches->tile_stride();
  view.matches->leave_out_nothing();
  masked_.assign(camera.tiles.size(), 0);
  const auto add = [&](std::uint32_t at, int du, int dv, std::uint64_t bits) {
    masked_[std::size_t(int(at) + dv * stride + du)] |= bits;
  };
  for (const std::uint32_t at : camera.listed) {
    const std::uint64_t w = camera.tiles[at].still;
    if (w == 0) continue;
    const std::uint64_t wide = widened(w), tall = heightened(w);
    add(at, 0, 0, heightened(wide));
    add(at, 0, -1, (wide & top_row) << 56);
    add(at, 0, 1, (wide & bottom_row) >> 56);
    add(at, -1, 0, (tall & left_column) << 7);
    add(at, 1, 0, (tall & right_column) >> 7);
  }
  const bool has_pixels = view.matches->has_pixels();
  std::size_t known = 0;
  for (std::size_t at = 0; at < masked_.size(); ++at) {
    if (masked_[at] == 0) continue;
    Tile& tile = camera.tiles[at];
    if (has_pixels) learn_usual(view, camera, tile_at(at, stride), masked_[at], tile);
    known += std::size_t(std::popcount(tile.known));
    view.matches->leave_out(at, has_pixels ? tile.known : masked_[at], has_pixels ? &tile.usual : nullptr);
  }
  if (has_pixels) {
    choose_probes(camera, known);
    view.matches->set_light(camera.light);
  }
  view.matches->look_anew();  // what was classified before has the mask of before
  describe(view, camera);
}

// Spread evenly over the masked pixels. The light of the sample is the new reference.
void StaticClutterMask::choose_probes(PerCamera& camera, std::size_t known) {
  camera.probes.clear();
  const std::size_t every = known / static_clutter.probes + 1;
  std::size_t n = 0;
  for (std::size_t at = 0; at < masked_.size(); ++at) {
    if (masked_[at] == 0) continue;
    const color::TileAt where = tile_at(at, camera.stride);
    for (std::uint64_t left = camera.tiles[at].known; left != 0; left &= left - 1) {
      const int bit = std::countr_zero(left);
      if (n++ % every == 0)
        camera.probes.push_back(
            {where.pixel_u() + bit % 8, where.pixel_v() + bit / 8, &camera.tiles[at].usual[std::size_t(bit)]});
    }
  }
  camera.light.gain = 1, camera.light.shift = {};
}

// Share and largest patch (8-connected tiles) of the clutter.
void StaticClutterMask::describe(const TargetView& view, const PerCamera& camera) {
  ColorShare& share = shares_[std::size_t(view.index)];
  share.still = 0, share.still_box = {}, share.still_px.setZero();
  is_visited_.assign(camera.tiles.size(), 0);
  int all = 0, largest = 0;
  for (const std::uint32_t first : camera.listed) {
    if (camera.tiles[first].still == 0 || is_visited_[first] != 0) continue;
    int pixels = 0;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    std::array<int, 4> box{view.image->width, view.image->height, 0, 0};
    open_.assign(1, first);
    is_visited_[first] = 1;
    while (!open_.empty()) {
      const int at = int(open_.back());
      open_.pop_back();
      const int u = color::TileAt::size * (at % camera.stride - 1), v = color::TileAt::size * (at / camera.stride - 1);
      const int here = std::popcount(camera.tiles[std::size_t(at)].still);
      pixels += here;
      sum += here * Eigen::Vector2d(u + tile_half_px, v + tile_half_px);
      box = {std::min(box[0], u), std::min(box[1], v), std::max(box[2], u + color::TileAt::size - 1),
             std::max(box[3], v + color::TileAt::size - 1)};
      for (int dv = -1; dv <= 1; ++dv) {
        for (int du = -1; du <= 1; ++du) {  // there is a margin tile on each side
          const auto next = std::size_t(at + dv * camera.stride + du);
          if (next >= camera.tiles.size() || is_visited_[next] != 0 || camera.tiles[next].still == 0) continue;
          is_visited_[next] = 1;
          open_.push_back(static_cast<std::uint32_t>(next));
        }
      }
    }
    all += pixels;
    if (pixels <= largest) continue;
    largest = pixels;
    share.still_px = sum / pixels;
    share.still_box = {box[0], box[1], std::min(box[2], view.image->width - 1),
                       std::min(box[3], view.image->height - 1)};
  }
  share.still = double(all) / (view.image->width * view.image->height);
}

}  // namespace huetrack::objects
