#include "object_tracking/trackers/color_watch.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "calib/model/median.h"
#include "color/image_color.h"
#include "object_tracking/trackers/color_follower.h"

namespace huetrack::object_trackers {

using namespace object_tracking;

namespace {

struct ColorWatchTuning {
  std::uint64_t sets_per_look = 3;        // light changes over seconds: at 30 sets/s this is ten looks a second
  double smoothing_s = 0.7;               // time constant of the measured colour
  int least_looks = 5;                    // before a warning
  float least_radius_px = 4;              // below it, half of the blurred and shared chroma is the background's
  float least_support = 0.5f;             // share of the disc that a view must show
  float inner_radii = 0.6f;               // of the disc: what is measured
  float whole_radii = 0.9f;               // measured pixels lie within this, however far the estimate is off
  double usual_exposure_s = 1.0 / 60;     // the object moves by at most a radius in it: its middle shows only itself
  int steps_per_radius = 5;               // of the grid of pixels that are measured
  double least_saturation_of_hue = 0.08;  // below it a hue is noise
};
constexpr ColorWatchTuning color_watch{};

// capacity: of the grid
constexpr std::size_t most_pixels = (2 * color_watch.steps_per_radius + 1) * (2 * color_watch.steps_per_radius + 1);
constexpr double sigma_of_mad = 1.4826;  // maths: of a normal distribution
constexpr std::size_t tail = 6;          // maths: of a Gaussian, about a sixth lies beyond one sigma on one side

struct Distribution {
  double median, below, above;
};
// Sorts the values. Outliers are what hides the object, or a highlight on it.
Distribution robust(std::span<double> values, double noise) {
  std::ranges::sort(values);
  const std::size_t n = values.size();
  const double median = values[n / 2];
  std::array<double, most_pixels> deviations;
  std::ranges::transform(values, deviations.begin(), [&](double value) { return std::abs(value - median); });
  const double reach =
      sighting_tuning.prediction_sigmas * sigma_of_mad * calib::median_in_place(std::span(deviations).first(n)) + noise;
  const auto first = std::ranges::lower_bound(values, median - reach),
             last = std::ranges::upper_bound(values, median + reach);
  const auto own = std::span(first, last);
  return {median, median - own[own.size() / tail], own[own.size() - 1 - own.size() / tail] - median};
}

bool sees_it_well(const ViewSupport& view) {
  return view.seen && view.support >= color_watch.least_support && view.radius_px >= color_watch.least_radius_px &&
         view.residual_px <= (color_watch.whole_radii - color_watch.inner_radii) * view.radius_px;
}

}  // namespace

double degrees_between(double from_deg, double to_deg) {
  return std::remainder(to_deg - from_deg, 360.0);
}

double middle_hue_deg(const color::HsiRange& range) {
  const double width = range.hue_max_deg - range.hue_min_deg + (range.hue_max_deg < range.hue_min_deg ? 360.0 : 0.0);
  return std::fmod(range.hue_min_deg + width / 2, 360.0);
}

AxisRange axis_range(const color::HsiRange& range, ColorAxis axis, double hue_origin_deg) {
  switch (axis) {
    case ColorAxis::hue:
      if (range.hue_min_deg == 0 && range.hue_max_deg == 360) return {-180, 180, false, false};
      return {degrees_between(hue_origin_deg, range.hue_min_deg), degrees_between(hue_origin_deg, range.hue_max_deg)};
    case ColorAxis::saturation:
      return {range.saturation_min, range.saturation_max, range.saturation_min > 0, range.saturation_max < 1};
    case ColorAxis::intensity:
      break;
  }
  return {range.intensity_min, range.intensity_max, range.intensity_min > 0, range.intensity_max < 1};
}

std::optional<SeenColor> color_inside(const capture::Image& image, const Eigen::Vector2f& px, float inner,
                                      double hue_origin_deg) {
  if (!(px.x() >= inner && px.y() >= inner && px.x() + inner < static_cast<float>(image.width) - 1 &&
        px.y() + inner < static_cast<float>(image.height) - 1))
    return std::nullopt;
  const int step = std::max(1, static_cast<int>(std::ceil(inner / color_watch.steps_per_radius)));
  const int reach = static_cast<int>(inner) / step;
  const int middle_u = static_cast<int>(std::lround(px.x())), middle_v = static_cast<int>(std::lround(px.y()));
  std::array<double, most_pixels> hues, saturations, intensities;
  std::size_t n = 0, with_hue = 0;
  for (int dv = -reach * step; dv <= reach * step; dv += step) {
    for (int du = -reach * step; du <= reach * step; du += step) {
      if (static_cast<float>(du * du + dv * dv) > inner * inner || n == most_pixels) continue;
      const color::Hsi pixel = color::hsi_of(color::rgb_at(image, middle_u + du, middle_v + dv));
      saturations[n] = pixel.saturation;
      intensities[n++] = pixel.intensity;
      if (pixel.has_hue && pixel.saturation >= color_watch.least_saturation_of_hue)
        hues[with_hue++] = degrees_between(hue_origin_deg, pixel.hue_deg);
    }
  }
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const Distribution h =
      2 * with_hue > n ? robust(std::span(hues).first(with_hue), color_noise[0]) : Distribution{nan, nan, nan};
  const Distribution s = robust(std::span(saturations).first(n), color_noise[1]);
  const Distribution i = robust(std::span(intensities).first(n), color_noise[2]);
  return SeenColor{{h.median, s.median, i.median}, {h.below, s.below, i.below}, {h.above, s.above, i.above}};
}

ColorWatch::ColorWatch(const calib::CameraRig& rig, const TargetOptions& target)
    : fastest_m_s_(target.radius_m / color_watch.usual_exposure_s) {
  for (const calib::Camera& camera : rig.cameras)
    cameras_.push_back({.hue_origin_deg = middle_hue_deg(target.color_in(camera.name))});
}

void ColorWatch::update(const capture::FrameSet& set, const ObjectEstimate& estimate,
                        std::span<const color::HsiRange> in_force) {
  const bool is_due = sets_++ % color_watch.sets_per_look == 0;
  if (estimate.state != TrackState::tracking || estimate.views < 2 || estimate.velocity.norm() > fastest_m_s_) return;
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    const ViewSupport& view = estimate.per_view[i];
    if (!set.frames[i] || !sees_it_well(view)) continue;
    // Pictures that come with matches are rare: all are used.
    const capture::Image* const picture = own_picture_of(*set.frames[i]);
    if (picture == nullptr || !(is_due || set.frames[i]->matches)) continue;
    PerCamera& camera = cameras_[i];
    const auto seen = color_inside(*picture, view.px, color_watch.inner_radii * view.radius_px, camera.hue_origin_deg);
    if (!seen) continue;
    const double pause_s = capture::seconds(set.at - std::exchange(camera.health.seen_at, set.at));
    // What was measured so long ago no longer counts: several looks are needed again.
    if (!camera.health.seen || pause_s < 0 || pause_s > color_watch.least_looks * color_watch.smoothing_s) {
      camera.health.seen = seen;
      camera.looks = 1;
      continue;
    }
    ++camera.looks;
    const double share = std::max(1 - std::exp(-pause_s / color_watch.smoothing_s), 1.0 / camera.looks);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (std::isnan(seen->median[axis])) continue;
      for (PerColorAxis SeenColor::*figure : {&SeenColor::median, &SeenColor::below, &SeenColor::above}) {
        double& smoothed = ((*camera.health.seen).*figure)[axis];
        const double fresh = ((*seen).*figure)[axis];
        smoothed = std::isnan(smoothed) ? fresh : smoothed + share * (fresh - smoothed);
      }
    }
    if (camera.looks >= color_watch.least_looks) judge(camera, in_force[i]);
  }
}

void ColorWatch::judge(PerCamera& camera, const color::HsiRange& in_force) {
  const SeenColor& seen = *camera.health.seen;
  std::optional<NearEnd>& warning = camera.health.near_end;
  double least = std::numeric_limits<double>::infinity();
  std::optional<NearEnd> nearest;
  bool is_cleared = true;
  const auto look_at_end = [&](ColorAxis axis, bool is_upper, double left, double reach) {
    const double share = left / reach;
    const bool is_warned = warning && warning->axis == axis && warning->is_upper == is_upper;
    if (is_warned) {
      warning->left = left;
      is_cleared = share > color_follower.just_inside;
    }
    if (share < least) least = share, nearest = NearEnd{axis, is_upper, left};
  };
  for (const ColorAxis axis : {ColorAxis::hue, ColorAxis::saturation, ColorAxis::intensity}) {
    const auto a = static_cast<std::size_t>(axis);
    if (std::isnan(seen.median[a])) continue;
    const AxisRange range = axis_range(in_force, axis, camera.hue_origin_deg);
    if (range.has_min) look_at_end(axis, false, seen.median[a] - range.min, seen.below[a] + color_noise[a]);
    if (range.has_max) look_at_end(axis, true, range.max - seen.median[a], seen.above[a] + color_noise[a]);
  }
  if (warning && !is_cleared) return;  // one end at a time
  const bool had = warning.has_value();
  warning = least < 1 ? nearest : std::nullopt;
  if (had || warning) ++changes_;
}

}  // namespace huetrack::object_trackers
