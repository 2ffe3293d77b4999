#include "object_tracking/trackers/color_follower.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "object_tracking/tracker_options.h"

namespace huetrack::object_trackers {

using namespace object_tracking;

namespace {

constexpr PerColorAxis furthest = furthest_followed;
// Smaller changes than half of the noise are not worth a table; one table is for at most twice the noise.
constexpr PerColorAxis least_step{color_noise[0] / 2, color_noise[1] / 2, color_noise[2] / 2};
constexpr PerColorAxis largest_step{2 * color_noise[0], 2 * color_noise[1], 2 * color_noise[2]};

// The shift nearest to `from` with which the object is `inside` times ColorWatch's distance from both ends.
PerColorAxis shift_between(const color::HsiRange& taught, const SeenColor& seen, double inside,
                           const PerColorAxis& from) {
  PerColorAxis shift = from;
  for (const ColorAxis axis : {ColorAxis::hue, ColorAxis::saturation, ColorAxis::intensity}) {
    const auto a = static_cast<std::size_t>(axis);
    if (std::isnan(seen.median[a])) continue;
    const AxisRange range = axis_range(taught, axis, middle_hue_deg(taught));
    double below = inside * (seen.below[a] + color_noise[a]), above = inside * (seen.above[a] + color_noise[a]);
    const double fit = std::min(1.0, (range.max - range.min) / (below + above));
    below *= fit, above *= fit;
    const double least = range.has_max ? seen.median[a] + above - range.max : -furthest[a];
    const double most = range.has_min ? seen.median[a] - below - range.min : furthest[a];
    shift[a] = std::clamp(std::max(std::min(from[a], most), least), -furthest[a], furthest[a]);
  }
  const double lowest = std::min(taught.saturation_min, color_follower.least_saturation);
  shift[1] = std::max(shift[1], lowest - taught.saturation_min);
  return shift;
}

}  // namespace

color::HsiRange shifted(const color::HsiRange& range, const PerColorAxis& shift) {
  color::HsiRange out = range;
  const bool is_any_hue = range.hue_min_deg == 0 && range.hue_max_deg == 360;
  if (!is_any_hue && shift[0] != 0) {
    const auto turned = [&](double hue_deg) { return std::fmod(hue_deg + shift[0] + 360, 360.0); };
    out.hue_min_deg = turned(range.hue_min_deg);
    out.hue_max_deg = turned(range.hue_max_deg);
  }
  const auto move = [](double& min, double& max, double by) {
    if (min > 0) min = std::clamp(min + by, 0.0, 1.0);
    if (max < 1) max = std::clamp(max + by, 0.0, 1.0);
  };
  move(out.saturation_min, out.saturation_max, shift[1]);
  move(out.intensity_min, out.intensity_max, shift[2]);
  return out;
}

PerColorAxis wanted_shift(const color::HsiRange& taught, const SeenColor& seen) {
  return shift_between(taught, seen, color_follower.well_inside, {});
}

ColorFollower::ColorFollower(const calib::CameraRig& rig, const TargetOptions& target) {
  for (const calib::Camera& camera : rig.cameras) {
    cameras_.push_back({.taught = target.color_in(camera.name)});
    in_force_.push_back(cameras_.back().taught);
  }
}

void ColorFollower::follow(const capture::FrameSet& set, const ObjectEstimate& estimate, const ColorWatch& watch,
                           TargetViews& views) {
  if (estimate.state == TrackState::tracking) {
    last_tracking_ = set.at;
  } else if (last_tracking_ && capture::seconds(set.at - *last_tracking_) > color_follower.forgotten_after_s) {
    forget(views);
    return;
  }
  if (!building_) begin_next(set, watch);
  if (!building_) return;
  building_->builder.go_on();
  if (!building_->builder.is_done()) return;
  const Building done = std::move(*building_);
  building_.reset();
  put_in_force(done.camera, done.shift, done.color, done.builder.table(), views);
}

// Begins a table for the camera whose range is furthest from the wanted one.
void ColorFollower::begin_next(const capture::FrameSet& set, const ColorWatch& watch) {
  double most = 1;  // least steps
  std::optional<std::size_t> next;
  PerColorAxis next_shift{};
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    const auto& seen = watch.in(i).seen;
    if (!seen || capture::seconds(set.at - watch.in(i).seen_at) > color_follower.longest_unseen_s || !set.frames[i] ||
        set.frames[i]->status != capture::FrameStatus::ok)
      continue;
    const PerColorAxis wanted = wanted_shift(cameras_[i].taught, *seen);
    PerColorAxis shift = cameras_[i].shift;
    // Only axes that must move do, as soon as a warning would not end, and back by a whole table: a ball that goes from
    // the window into the shade is no change of light.
    const PerColorAxis nearest = shift_between(cameras_[i].taught, *seen, color_follower.just_inside, shift);
    double behind = 0;
    for (std::size_t a = 0; a < shift.size(); ++a) {
      const bool is_back = std::abs(shift[a]) - std::abs(wanted[a]) >= largest_step[a];
      if (nearest[a] == shift[a] && !is_back) continue;
      const double step = wanted[a] - shift[a];
      behind = std::max(behind, std::abs(step) / least_step[a]);
      shift[a] += std::clamp(step, -largest_step[a], largest_step[a]);
    }
    if (behind < most) continue;
    most = behind;
    next = i;
    next_shift = shift;
  }
  if (!next) return;
  const color::HsiRange color = shifted(cameras_[*next].taught, next_shift);
  const capture::Image& image = set.frames[*next]->pixels;
  building_.emplace(Building{*next, next_shift, color, color::ColorTableBuilder(color, image.format, image.range)});
}

void ColorFollower::put_in_force(std::size_t camera, const PerColorAxis& shift, const color::HsiRange& color,
                                 std::shared_ptr<const color::ColorTable> table, TargetViews& views) {
  auto before = views.recolor(camera, color, std::move(table));
  if (!cameras_[camera].taught_table) cameras_[camera].taught_table = std::move(before);
  cameras_[camera].shift = shift;
  in_force_[camera] = color;
}

void ColorFollower::forget(TargetViews& views) {
  building_.reset();
  last_tracking_.reset();
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    if (cameras_[i].taught_table) put_in_force(i, {}, cameras_[i].taught, cameras_[i].taught_table, views);
  }
}

}  // namespace huetrack::object_trackers
