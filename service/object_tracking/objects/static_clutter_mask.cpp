#include "object_tracking/objects/static_clutter_mask.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

namespace huetrack::objects {

using namespace object_tracking;

namespace {

constexpr double every_s = 0.5;  // each view
constexpr int grid_px = color::TileAt::size;
constexpr double enough_points = 4800;  // to say how much of a picture has the colour: 15 of the least share
// Of the share that objects could cover: more is the room's, as a radius may be wrong by half. Below the lower one it
// is not any more.
constexpr double shared_above = 2.5, shared_below = 1.5;
constexpr double least_shared = 0.003;  // of a picture; fewer grid points than some ten are chance
// Of the last four samples: what is there for a second and a half, but for a flicker, is there.
constexpr int least_matched = 3;
// An object that is tracked covers so much more than its disc: blur, and it moves on before the next set.
constexpr double covered_radii = 1.4, covered_more_px = 3;

// Where so much of what is around it has its colour, too, nobody sees an object there, and what would be left of the
// room's colour in its place would look like one.
constexpr double surrounded = 0.5;
constexpr int around = 24;  // points that are looked at

// A disc, by its area against the smallest and the largest that an object may have, by its half widths, and by how much
// of the ellipse of these it fills.
constexpr double least_disc = 0.6, roundest = 0.75, least_filled = 0.85;
// What is left out so near to a region's middle may have cut it.
constexpr double cut_reach = 1.5;  // radii
// The middle of what a straight edge leaves of a disc, by the share that is left: 0.42 radii of a half, 0.65 of a
// quarter.
constexpr double off_by_cut = 0.85;  // radii, times the share that is missing

constexpr std::uint64_t left_column = 0x0101010101010101u, right_column = left_column << 7;
constexpr std::uint64_t top_row = 0xff, bottom_row = top_row << 56;

// Pixels that are set in at least least_matched of four words.
std::uint64_t mostly(const std::array<std::uint64_t, 4>& words) {
  static_assert(least_matched == 3);
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

// By the target's colour.
bool is_surrounded(const TargetView& view, const Sighting& s) {
  const double reach = covered_radii * s.radius_px + covered_more_px + 1;
  int seen = 0, matching = 0;
  for (int i = 0; i < around; ++i) {
    const double angle = 2 * std::numbers::pi * i / around;
    const double u = s.px.x() + reach * std::cos(angle), v = s.px.y() + reach * std::sin(angle);
    if (!(u >= 0 && v >= 0 && u < view.image->width && v < view.image->height)) continue;
    const int column = static_cast<int>(u), row = static_cast<int>(v);
    const color::TileAt tile{static_cast<std::uint16_t>(column / color::TileAt::size + 1),
                             static_cast<std::uint16_t>(row / color::TileAt::size + 1)};
    const int bit = row % color::TileAt::size * 8 + column % color::TileAt::size;
    ++seen;
    matching += (view.matches->tile_with_left_out(tile) >> bit & 1) != 0 ? 1 : 0;
  }
  return matching > surrounded * seen;
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
  const double reach_px = cut_reach * radius_px;
  const PerCamera& in = cameras_[camera];
  if (in.listed.empty() || !px.allFinite()) return false;
  const int rows = static_cast<int>(in.tiles.size()) / in.stride;
  const auto tile_of = [](double at, int count) {
    return static_cast<int>(std::clamp(std::floor(at / color::TileAt::size) + 1, 0.0, count - 1.0));
  };
  for (int v = tile_of(px.y() - reach_px, rows); v <= tile_of(px.y() + reach_px, rows); ++v) {
    for (int u = tile_of(px.x() - reach_px, in.stride); u <= tile_of(px.x() + reach_px, in.stride); ++u) {
      std::uint64_t still = in.tiles[static_cast<std::size_t>(v * in.stride + u)].still;
      for (; still != 0; still &= still - 1) {
        const int bit = std::countr_zero(still);
        const Eigen::Vector2d at(color::TileAt::size * (u - 1) + bit % 8, color::TileAt::size * (v - 1) + bit / 8);
        if ((at - px).norm() <= reach_px) return true;
      }
    }
  }
  return false;
}

void StaticClutterMask::mark_clipped(std::vector<Sighting>& sightings) const {
  if (!is_room_shared_) return;
  for (Sighting& s : sightings) {
    const double radius_px = s.support > 0 ? s.radius_px / std::sqrt(s.support) : s.radius_px;  // of its whole disc
    if (!may_clip(static_cast<std::size_t>(s.row.camera), s.px, radius_px)) continue;
    s.is_cut = true;
    if (s.is_outline) continue;
    const double off_px = off_by_cut * (1 - s.support) * radius_px;
    s.covariance.diagonal().array() += off_px * off_px;
  }
}

void StaticClutterMask::look(const std::vector<TargetView>& views, std::span<const Sighting> tracked,
                             capture::Timestamp set_at) {
  if (views.empty()) return;
  if (!last_at_) {
    for (const TargetView& view : views) measure(view);  // one view tells it of the room, and so of all
    if (std::ranges::any_of(cameras_, &PerCamera::is_above)) {
      first_at_ = set_at;
      for (const TargetView& view : views)
        find_what_may_be_objects(view, cameras_[static_cast<std::size_t>(view.index)]);
    }
    for (const TargetView& view : views) sample(view, tracked);
    last_at_ = set_at;
    return;
  }
  for (const TargetView& view : views) {  // the first ones at once: noise is another one in each
    const PerCamera& camera = cameras_[static_cast<std::size_t>(view.index)];
    if (camera.is_learning && camera.sampled < samples) sample(view, tracked);
  }
  if (std::abs(capture::seconds(set_at - *last_at_)) < every_s / static_cast<double>(views.size())) return;
  last_at_ = set_at;
  sample(views[next_++ % views.size()], tracked);
}

bool StaticClutterMask::is_starting(capture::Timestamp set_at) const {
  return is_room_shared_ && first_at_ && capture::seconds(set_at - *first_at_) < samples * every_s;
}

// Whole discs of an object's size: as they are at the first set, before anything is left out.
void StaticClutterMask::find_what_may_be_objects(const TargetView& view, PerCamera& camera) {
  if (camera.largest_px == 0) return;
  const double smallest_disc = std::numbers::pi * camera.smallest_px * camera.smallest_px;
  const double largest_disc = std::numbers::pi * camera.largest_px * camera.largest_px;
  const int step = std::max(1, static_cast<int>(std::numbers::sqrt2 * camera.smallest_px));
  const int usual = static_cast<int>(2 * std::sqrt(camera.smallest_px * camera.largest_px)) + 2;
  const int largest = static_cast<int>(4 * camera.largest_px) + 2;
  for (const color::ColorRegion& region : camera.finder.components(*view.matches, step, {}, usual, largest,
                                                                   static_cast<int>(least_disc * smallest_disc))) {
    const Eigen::Vector2d half = 2 * Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>()
                                         .computeDirect(region.spread)
                                         .eigenvalues()
                                         .cwiseMax(0)
                                         .cwiseSqrt();  // ascending
    const double filled = region.area / (std::numbers::pi * half.x() * half.y());
    if (region.area < least_disc * smallest_disc || region.area > largest_disc / least_disc ||
        half.x() < roundest * half.y() || filled < least_filled)
      continue;
    Sighting& s = camera.may_be_objects.emplace_back();
    s.row.camera = view.index;
    s.px = region.centre;
    s.radius_px = std::sqrt(region.area / std::numbers::pi);
  }
  view.matches->look_anew();  // classified anew, with what is left out by then
}

void StaticClutterMask::measure(const TargetView& view) {
  PerCamera& camera = cameras_[static_cast<std::size_t>(view.index)];
  ColorShare& share = shares_[static_cast<std::size_t>(view.index)];
  // Where only the share is asked for, no more points than tell it.
  const double pixels = static_cast<double>(view.image->width) * view.image->height;
  const int wide_px = static_cast<int>(std::sqrt(pixels / enough_points));
  hits_px_ = camera.is_learning ? grid_px : std::max(grid_px, wide_px);
  view.matches->grid_with_left_out(hits_px_, hits_);
  const double probed = std::max(1.0, std::floor((view.image->width + hits_px_ / 2.0) / hits_px_) *
                                          std::floor((view.image->height + hits_px_ / 2.0) / hits_px_));
  share.of_picture = std::min(1.0, static_cast<double>(hits_.size()) / probed);
  const double bound = (camera.is_above ? shared_below : shared_above) * share.of_target;
  camera.is_above = share.of_picture > std::max(least_shared, bound);
}

void StaticClutterMask::sample(const TargetView& view, std::span<const Sighting> tracked) {
  measure(view);
  PerCamera& camera = cameras_[static_cast<std::size_t>(view.index)];
  // Of several objects, what stands still and is none of those that are tracked is none; one alone may be lost, and
  // rest.
  is_room_shared_ = std::ranges::any_of(cameras_, &PerCamera::is_above);
  const bool is_learning = is_room_shared_ || (count_ > 1 && camera.sampled > 0);
  if (!is_learning && camera.is_learning) {
    view.matches->leave_out_nothing();
    camera = {.tiles = {}, .listed = {}, .sampled = 1};  // there is a past, and it had nothing
    ColorShare& share = shares_[static_cast<std::size_t>(view.index)];
    share.still = 0, share.still_box = {}, share.still_px.setZero();
    return;
  }
  camera.is_learning = is_learning;
  if (!is_learning) {
    camera.sampled = 1;
    return;
  }
  if (hits_px_ != grid_px) view.matches->grid_with_left_out(grid_px, hits_);
  learn(view, camera, tracked);
  leave_out(view, camera);
}

void StaticClutterMask::learn(const TargetView& view, PerCamera& camera, std::span<const Sighting> tracked) {
  const int stride = view.matches->tile_stride();
  if (camera.tiles.empty()) {
    camera.tiles.resize(static_cast<std::size_t>(stride * view.matches->tile_rows()));
    camera.stride = stride;
    // A room that came to share the colour later has not been still for so long: its past had none of it.
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
  const auto place = static_cast<std::size_t>(camera.sampled % kept_samples);
  const auto before = [&](int sets) {  // in the ring; 0: now
    return static_cast<std::size_t>((camera.sampled + kept_samples - sets) % kept_samples);
  };
  covering_.assign(camera.may_be_objects.begin(), camera.may_be_objects.end());
  for (const Sighting& s : tracked)
    if (s.row.camera == view.index && !is_surrounded(view, s)) covering_.push_back(s);
  for (const std::uint32_t at : camera.listed) {
    Tile& tile = camera.tiles[at];
    const color::TileAt where{static_cast<std::uint16_t>(static_cast<int>(at) % stride),
                              static_cast<std::uint16_t>(static_cast<int>(at) / stride)};
    std::uint64_t covered = 0;
    for (const Sighting& s : covering_) {
      const double reach = covered_radii * s.radius_px + covered_more_px;
      const double du = where.pixel_u() + 3.5 - s.px.x(), dv = where.pixel_v() + 3.5 - s.px.y();
      if (std::hypot(du, dv) > reach + 6) continue;
      for (int bit = 0; bit < 64; ++bit) {
        const int column = bit % 8, row = bit / 8;
        const double u = where.pixel_u() + column - s.px.x(), v = where.pixel_v() + row - s.px.y();
        if (u * u + v * v < reach * reach) covered |= std::uint64_t{1} << bit;
      }
    }
    const std::uint64_t matched = view.matches->tile_with_left_out(where);
    tile.matched[place] = (matched & ~covered) | (tile.still & covered);
  }
  std::erase_if(camera.listed, [&](std::uint32_t at) {
    Tile& tile = camera.tiles[at];
    std::array<std::uint64_t, samples> last;
    for (int i = 0; i < samples; ++i) last[static_cast<std::size_t>(i)] = tile.matched[before(i)];
    std::uint64_t matched = 0, gone = 0, again = 0, known = 0;
    for (int i = kept_samples - 1; i >= 0; --i) {  // from the oldest one on
      const std::uint64_t now = tile.matched[before(i)];
      again |= gone & now;
      matched |= now;
      gone |= matched & ~now;
      if (i > 0) known |= now;
    }
    const std::uint64_t ever = last[0] | last[1] | last[2] | last[3];
    // What was still stays so as long as it is seen at all: noise decides at edges, and would be what moves. Of the
    // first samples what is there for the first time is new: it moves, or will come again.
    if (camera.sampled == 0)
      tile.still = last[0];
    else if (camera.sampled < samples)
      tile.still = known;
    else
      tile.still = (tile.still & ever) | mostly(last) | (is_room_shared_ ? again : 0);
    tile.is_listed = matched != 0;
    return !tile.is_listed;
  });
  if (++camera.sampled == samples) camera.may_be_objects.clear();  // from now on what stands still is known
}

// With a pixel more on each side: at an edge noise decides.
void StaticClutterMask::leave_out(const TargetView& view, PerCamera& camera) {
  const int stride = view.matches->tile_stride();
  view.matches->leave_out_nothing();
  const auto add = [&](std::uint32_t at, int du, int dv, std::uint64_t bits) {
    if (bits != 0) view.matches->leave_out(static_cast<std::size_t>(static_cast<int>(at) + dv * stride + du), bits);
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
  describe(view, camera);
}

// How much it is, and where the largest of its patches is, as tiles touch.
void StaticClutterMask::describe(const TargetView& view, const PerCamera& camera) {
  ColorShare& share = shares_[static_cast<std::size_t>(view.index)];
  share.still = 0, share.still_box = {}, share.still_px.setZero();
  is_told_.assign(camera.tiles.size(), 0);
  int all = 0, largest = 0;
  for (const std::uint32_t first : camera.listed) {
    if (camera.tiles[first].still == 0 || is_told_[first] != 0) continue;
    int pixels = 0;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    std::array<int, 4> box{view.image->width, view.image->height, 0, 0};
    open_.assign(1, first);
    is_told_[first] = 1;
    while (!open_.empty()) {
      const int at = static_cast<int>(open_.back());
      open_.pop_back();
      const int u = color::TileAt::size * (at % camera.stride - 1), v = color::TileAt::size * (at / camera.stride - 1);
      const int here = std::popcount(camera.tiles[static_cast<std::size_t>(at)].still);
      pixels += here;
      sum += here * Eigen::Vector2d(u + 3.5, v + 3.5);
      box = {std::min(box[0], u), std::min(box[1], v), std::max(box[2], u + color::TileAt::size - 1),
             std::max(box[3], v + color::TileAt::size - 1)};
      for (int dv = -1; dv <= 1; ++dv) {
        for (int du = -1; du <= 1; ++du) {  // there is a margin tile on each side
          const auto next = static_cast<std::size_t>(at + dv * camera.stride + du);
          if (next >= camera.tiles.size() || is_told_[next] != 0 || camera.tiles[next].still == 0) continue;
          is_told_[next] = 1;
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
  share.still = static_cast<double>(all) / (view.image->width * view.image->height);
}

}  // namespace huetrack::objects
