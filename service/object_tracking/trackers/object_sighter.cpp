#include "object_tracking/trackers/object_sighter.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace huetrack::object_trackers {

using namespace object_tracking;

namespace {

// The power density is of a kick at any moment since the last set. One just after it takes the object further, by its
// whole velocity: as far as a density of three times as much.
constexpr double at_once_share = 3;
constexpr double contradicting_px2 = 1;  // doubt of a view, far above what light and a good calibration leave open

// Beyond the box, at a side that is not the image's.
bool goes_on(const color::ColorRegion& region, const color::PixelBox& box, const color::MatchBits& image) {
  return (region.box.u_min == box.u_min && box.u_min > 0) || (region.box.v_min == box.v_min && box.v_min > 0) ||
         (region.box.u_max == box.u_max && box.u_max < image.width() - 1) ||
         (region.box.v_max == box.v_max && box.v_max < image.height() - 1);
}

// Along both of its axes the region is far wider than the object, and no smear makes it so.
bool is_wider_than_object(const color::ColorRegion& region, double radius_px) {
  constexpr double widest_radii = 2;  // the taught radius may be wrong, and so may the distance
  const double half_trace = region.spread.trace() / 2;
  const double narrow = half_trace - std::sqrt(std::max(0.0, half_trace * half_trace - region.spread.determinant()));
  return 2 * std::sqrt(std::max(0.0, narrow)) > widest_radii * radius_px;
}

// Nearly all that is the object's lies within the first of these; what goes on beyond it is looked at as far as the
// second.
constexpr double looked_at_radii[] = {1.5, 2};
constexpr double parts_radii = 1.3;  // that are so near one another are one region

}  // namespace

Eigen::Matrix2d spread_in(const TargetView& view, const ExpectedView& expected, const ObjectFilter& filter,
                          const ViewConsistency& agreement, double acceleration_m_s2) {
  const MotionState& belief = filter.belief();
  const BallProjection& at = expected.at;
  const double dt = capture::seconds(expected.row.at - belief.at);
  const double reach_m = acceleration_m_s2 * dt * dt;
  const Eigen::Matrix3d spread =
      belief.seen_covariance(expected.row, filter.power_density()) + reach_m * reach_m * Eigen::Matrix3d::Identity();
  Eigen::Matrix2d out = at.jacobian * spread * at.jacobian.transpose();
  agreement.inflate_prediction(static_cast<std::size_t>(view.index), *view.camera, belief.position_at(expected.row.at), at, out);
  return out;
}

// The regions large enough to be the object within three standard deviations of where it is expected, and its disc.
// None where that is nowhere near the image. Valid until the next call.
// What is larger than the object is none: as much as is looked at of it lies around where the object was expected,
// wherever that is, and would confirm any expectation.
std::span<const color::ColorRegion> ObjectSighter::regions_near(const TargetView& view, const BallProjection& at,
                                                                const Eigen::Matrix2d& spread) {
  // Not beyond the image's own size around it: a box is clipped to the image anyway, and an int must hold it.
  const double limit = view.matches->width() + view.matches->height();
  if (!(std::abs(at.px.x()) < 2 * limit && std::abs(at.px.y()) < 2 * limit)) return {};
  const double disc = std::numbers::pi * at.radius_px * at.radius_px;
  const int min_area = std::max(2, static_cast<int>(sighting_tuning.min_disc_share * disc));
  for (const double radii : looked_at_radii) {
    const double reach_u = std::min(limit, 3 * std::sqrt(spread(0, 0)) + radii * at.radius_px + 2);
    const double reach_v = std::min(limit, 3 * std::sqrt(spread(1, 1)) + radii * at.radius_px + 2);
    const color::PixelBox box{
        static_cast<int>(std::floor(at.px.x() - reach_u)), static_cast<int>(std::floor(at.px.y() - reach_v)),
        static_cast<int>(std::ceil(at.px.x() + reach_u)), static_cast<int>(std::ceil(at.px.y() + reach_v))};
    near_.clear();
    bool is_cut = false;
    for (const color::ColorRegion& region : finders_[static_cast<std::size_t>(view.index)].find(
             *view.matches, box, min_area, parts_radii * at.radius_px)) {
      if (goes_on(region, box, *view.matches))
        is_cut = true;
      else if (!is_wider_than_object(region, at.radius_px))
        near_.push_back(region);
    }
    if (!near_.empty() && !is_cut) break;
  }
  return near_;
}

// Cameras, drivers and cables show a frame once more now and then, with a new stamp. No two frames have the same noise:
// one in which the region of a moving object is the same to its last pixel is the frame before, and says nothing of
// now. Twice in a row the object stands still, in pictures without noise.
bool ObjectSighter::is_repeated(const TargetView& view, std::span<const color::ColorRegion> regions,
                                const BallProjection& at, const MotionState& belief) {
  LastRegion& last = last_[static_cast<std::size_t>(view.index)];
  const double moved_px =
      (at.jacobian * belief.velocity()).norm() * capture::seconds(view.frame->captured_at - last.captured_at);
  last.is_repeated = !last.is_repeated && moved_px > sighting_tuning.repeat_px &&
                     std::ranges::any_of(regions, [&](const color::ColorRegion& region) {
                       return region.area == last.region.area && region.centre == last.region.centre;
                     });
  return last.is_repeated;
}

void ObjectSighter::sight(const std::vector<TargetView>& views, const ObjectFilter& filter,
                          const ViewConsistency& agreement, std::vector<Sighting>& out) {
  const MotionState& belief = filter.belief();
  bool is_room_suspected = false;
  for (std::size_t c = 0; c < last_.size(); ++c) is_room_suspected = is_room_suspected || agreement.inflation_px2(c) > contradicting_px2;
  for (const TargetView& view : views) {
    const auto expected = expected_in(view, belief, radius_m_);
    if (!expected) continue;
    const BallProjection& at = expected->at;
    const Eigen::Matrix2d s = spread_in(view, *expected, filter, agreement, options_.acceleration_m_s2);
    double best = -std::numeric_limits<double>::infinity();
    std::optional<Sighting> chosen;
    color::ColorRegion chosen_region;
    const std::span<const color::ColorRegion> regions = regions_near(view, at, s);
    if (is_repeated(view, regions, at, belief)) continue;
    for (const color::ColorRegion& region : regions) {
      const Sighting sighting =
          sighting_of(view, region, at.radius_px, options_.pixel_noise_px, image_motion(view, at, belief));
      const Eigen::Matrix2d total =
          s + sighting.covariance + sighting.bias_sigma_px * sighting.bias_sigma_px * Eigen::Matrix2d::Identity();
      const Eigen::Vector2d d = sighting.px - at.px;
      const double d2 = d.dot(total.inverse() * d);
      if (d2 > sighting_tuning.gate_nis) continue;
      const double score = std::log(sighting.support) - 0.5 * d2 - 0.5 * std::log(sighting.covariance.determinant());
      if (score > best) best = score, chosen = sighting, chosen_region = region;
    }
    if (!chosen) continue;
    last_[static_cast<std::size_t>(view.index)] = {chosen_region, view.frame->captured_at};
    // Views that contradict one another are not made sharper: which of them is wrong, their outlines do not say.
    if (!is_room_suspected) outlines_.sharpen(view, belief, *expected, s, *chosen);
    chosen->row = row_of(view, chosen->px.y(), belief);
    out.push_back(*chosen);
  }
  sort_by_time(out);
}

void ObjectSighter::sharpen(const std::vector<TargetView>& views, const MotionState& about,
                            std::vector<Sighting>& sightings) {
  for (Sighting& sighting : sightings) {
    const auto view = std::ranges::find(views, sighting.row.camera, &TargetView::index);
    if (view == views.end()) continue;
    const auto expected = expected_in(*view, about, radius_m_);
    if (!expected) continue;
    const Eigen::Matrix<double, 2, 3>& by = expected->at.jacobian;
    if (outlines_.sharpen(*view, about, *expected, by * about.position_covariance() * by.transpose(), sighting))
      sighting.row = row_of(*view, sighting.px.y(), about);
  }
}

bool ObjectSighter::sight_after_bounce(const std::vector<TargetView>& views, const TargetOptions& target,
                                       const MotionState& belief, double power_density, std::size_t least,
                                       std::vector<Sighting>& out) {
  const double reach_density = at_once_share * power_density;
  double dt = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    regions_[i].clear();
    const auto expected = expected_in(views[i], belief, radius_m_);
    if (!expected || last_[static_cast<std::size_t>(views[i].index)].is_repeated) continue;
    dt = std::max(dt, capture::seconds(expected->row.at - belief.at));
    const BallProjection& at = expected->at;
    const Eigen::Matrix3d spread = belief.seen_covariance(expected->row, reach_density);
    const auto near = regions_near(views[i], at, at.jacobian * spread * at.jacobian.transpose());
    regions_[i].assign(near.begin(), near.end());
  }
  const Eigen::Vector3d expected = belief.position() + dt * belief.velocity();
  const double reach_m =
      3 * (std::sqrt(reach_density * dt * dt * dt / 3) + std::sqrt(largest_variance(belief.position_covariance())));
  for (const PositionCandidate& c : cross_rays(views, std::span(regions_).first(views.size()), target, options_, belief,
                                               sighting_tuning.max_crossings)) {
    if ((c.position - expected).norm() > reach_m || c.sightings.size() <= least) continue;
    out = c.sightings;
    sort_by_time(out);
    return true;
  }
  return false;
}

}  // namespace huetrack::object_trackers
