#include "object_tracking/trackers/object_sighter.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "object_tracking/ball_outline.h"

namespace huetrack::object_trackers {

using namespace object_tracking;

namespace {

struct ObjectSighterTuning {
  double contradicting_px2 = 1;  // inflation of a view above which no outline is fitted; far above shading
  double widest_radii = 2;  // half width of the narrow axis of a region; the taught radius and the range are unsure
};
constexpr ObjectSighterTuning sighter{};
// The largest region of one object lies within this; a region that this box cuts is searched wider.
constexpr double usual_reach_radii = sighting_tuning.extent_radii / 2;

// maths: a kick at any moment of dt is a white acceleration of power density kick^2 / dt, variance kick^2 dt^2 / 3. A
// kick at its beginning has kick^2 dt^2.
constexpr double at_once_share = 3;

// The box cuts the region, at a side that is not the image's.
bool goes_on(const color::ColorRegion& region, const color::PixelBox& box, const color::MatchBits& image) {
  return (region.box.u_min == box.u_min && box.u_min > 0) || (region.box.v_min == box.v_min && box.v_min > 0) ||
         (region.box.u_max == box.u_max && box.u_max < image.width() - 1) ||
         (region.box.v_max == box.v_max && box.v_max < image.height() - 1);
}

// The narrow axis of the region is far wider than the object, which no motion blur explains.
bool is_wider_than_object(const color::ColorRegion& region, double radius_px) {
  const double half_trace = region.spread.trace() / 2;
  const double narrow = half_trace - std::sqrt(std::max(0.0, half_trace * half_trace - region.spread.determinant()));
  return 2 * std::sqrt(std::max(0.0, narrow)) > sighter.widest_radii * radius_px;
}

// Of the disc's pixels in the image.
double matching_share(color::MatchBits& matches, const BallProjection& disc) {
  const auto first = [&](double px) { return std::max(0, int(std::ceil(px - disc.radius_px))); };
  const auto last = [&](double px, int size) { return int(std::min(size - 1.0, px + disc.radius_px)); };
  int matching = 0, all = 0;
  for (int v = first(disc.px.y()); v <= last(disc.px.y(), matches.height()); ++v) {
    for (int u = first(disc.px.x()); u <= last(disc.px.x(), matches.width()); ++u) {
      if ((Eigen::Vector2d(u, v) - disc.px).squaredNorm() >= disc.radius_px * disc.radius_px) continue;
      ++all;
      matching += matches.at(u, v) ? 1 : 0;
    }
  }
  return all > 0 ? double(matching) / all : 0;
}

}  // namespace

Eigen::Matrix2d predicted_spread(const TargetView& view, const ExpectedView& expected, const ObjectFilter& filter,
                                 const ViewConsistency& agreement, double acceleration_m_s2) {
  const MotionState& motion = filter.motion();
  const BallProjection& at = expected.at;
  const double dt = capture::seconds(expected.row.at - motion.at);
  const double reach_m = acceleration_m_s2 * dt * dt;
  const Eigen::Matrix3d spread =
      motion.seen_covariance(expected.row, filter.power_density()) + reach_m * reach_m * Eigen::Matrix3d::Identity();
  Eigen::Matrix2d out = at.jacobian * spread * at.jacobian.transpose();
  agreement.inflate_prediction(static_cast<std::size_t>(view.index), *view.camera, motion.position_at(expected.row.at),
                               at, out);
  return out;
}

// Regions large enough to be the object, within the gate around its predicted disc. A region much larger than the
// object is left out: the part of it inside of the box lies around the prediction, and would confirm any prediction.
// Valid until the next call.
std::span<const color::ColorRegion> ObjectSighter::regions_near(const TargetView& view, const BallProjection& at,
                                                                const Eigen::Matrix2d& spread) {
  // The box is clipped to the image anyway; its corners must fit an int.
  const double limit = view.matches->width() + view.matches->height();
  if (!(std::abs(at.px.x()) < 2 * limit && std::abs(at.px.y()) < 2 * limit)) return {};
  const double disc = std::numbers::pi * at.radius_px * at.radius_px;
  const int min_area = std::max(2, static_cast<int>(sighting_tuning.min_disc_share * disc));
  for (const double radii : {usual_reach_radii, sighter.widest_radii}) {
    const double reach_u =
        std::min(limit, sighting_tuning.prediction_sigmas * std::sqrt(spread(0, 0)) + radii * at.radius_px + 2);
    const double reach_v =
        std::min(limit, sighting_tuning.prediction_sigmas * std::sqrt(spread(1, 1)) + radii * at.radius_px + 2);
    const color::PixelBox box{
        static_cast<int>(std::floor(at.px.x() - reach_u)), static_cast<int>(std::floor(at.px.y() - reach_v)),
        static_cast<int>(std::ceil(at.px.x() + reach_u)), static_cast<int>(std::ceil(at.px.y() + reach_v))};
    near_.clear();
    if (view.matches->room() != nullptr) {
      const auto& discs =
          disc_finders_[static_cast<std::size_t>(view.index)].find(*view.matches, box, at.radius_px, at.radius_px);
      if (!discs.empty()) return discs;
    }
    bool is_cut = false;
    for (const color::ColorRegion& region : finders_[static_cast<std::size_t>(view.index)].find(
             *view.matches, box, min_area, sighting_tuning.part_radii * at.radius_px)) {
      if (goes_on(region, box, *view.matches))
        is_cut = true;
      else if (!is_wider_than_object(region, at.radius_px))
        near_.push_back(region);
    }
    if (!near_.empty() && !is_cut) break;
  }
  return near_;
}

// Cameras and drivers sometimes deliver a frame again with a new stamp. As no two frames have the same noise, a frame
// in which a moving object's region is the same to the last pixel is the one before. Twice in a row means that the
// object is at rest, in pictures without noise.
bool ObjectSighter::is_repeated(const TargetView& view, std::span<const color::ColorRegion> regions,
                                const BallProjection& at, const MotionState& motion) {
  LastRegion& last = last_[static_cast<std::size_t>(view.index)];
  const double moved_px =
      (at.jacobian * motion.velocity()).norm() * capture::seconds(view.frame->captured_at - last.captured_at);
  last.is_repeated = !last.is_repeated && moved_px > sighting_tuning.same_place_px &&
                     std::ranges::any_of(regions, [&](const color::ColorRegion& region) {
                       return region.area == last.region.area && region.centre == last.region.centre;
                     });
  return last.is_repeated;
}

double ObjectSighter::UsualSize::missing(double log_size) const {
  return count > 0 ? std::max(0.0, 1 - std::exp(2 * (log_size - mean + std::sqrt(variance)))) : 0.0;
}

void ObjectSighter::UsualSize::add(double log_size) {
  const double whole = std::pow(1 - missing(log_size), 2), off = log_size - mean;
  count = std::min(sighting_tuning.size_memory, count + whole);
  mean += whole / count * off;
  variance += whole / (count + 1) * (off * off - variance);
}

void ObjectSighter::sight(const std::vector<TargetView>& views, const ObjectFilter& filter,
                          const ViewConsistency& agreement, std::vector<Sighting>& out) {
  const MotionState& motion = filter.motion();
  bool is_inconsistent = false;
  for (std::size_t c = 0; c < last_.size(); ++c)
    is_inconsistent = is_inconsistent || agreement.inflation_px2(c) > sighter.contradicting_px2;
  for (const TargetView& view : views) {
    const auto expected = expected_in(view, motion, radius_m_);
    if (!expected) continue;
    const BallProjection& at = expected->at;
    const Eigen::Matrix2d s = predicted_spread(view, *expected, filter, agreement, options_.acceleration_m_s2);
    double best = -std::numeric_limits<double>::infinity();
    std::optional<Sighting> chosen;
    color::ColorRegion chosen_region;
    const std::span<const color::ColorRegion> regions = regions_near(view, at, s);
    if (is_repeated(view, regions, at, motion)) continue;
    for (const color::ColorRegion& region : regions) {
      const Sighting sighting =
          sighting_of(view, region, at.radius_px, options_.pixel_noise_px, image_motion(view, at, motion));
      const Eigen::Matrix2d total =
          s + sighting.covariance + sighting.bias_sigma_px * sighting.bias_sigma_px * Eigen::Matrix2d::Identity();
      const Eigen::Vector2d d = sighting.px - at.px;
      const double d2 = d.dot(total.inverse() * d);
      if (d2 > sighting_tuning.gate_nis) continue;
      const double score = std::log(sighting.support) - 0.5 * d2 - 0.5 * std::log(sighting.covariance.determinant());
      if (score > best) best = score, chosen = sighting, chosen_region = region;
    }
    if (!chosen) {
      if (auto merged = is_inconsistent ? std::nullopt : outline_of_merged(view, motion, *expected, s)) {
        merged->row = row_of(view, merged->px.y(), motion);
        out.push_back(*merged);
      }
      continue;
    }
    last_[static_cast<std::size_t>(view.index)] = {chosen_region, view.frame->captured_at};
    UsualSize& usual = usual_[static_cast<std::size_t>(view.index)];
    const double log_size = std::log(disc_radius(chosen_region.area) / at.radius_px);
    chosen->missing = usual.missing(log_size);
    usual.add(log_size);
    measure_covered(view, at, motion, *chosen);
    if (motion.has_size()) measure_hull(view, chosen_region, image_motion(view, at, motion), *chosen);
    // Inconsistent views are not refined: outlines do not show which view is wrong.
    if (!is_inconsistent) outlines_.sharpen(view, motion, *expected, s, *chosen);
    chosen->row = row_of(view, chosen->px.y(), motion);
    out.push_back(*chosen);
  }
  sort_by_time(out);
}

// While something else is around the object, as the hand that holds it, its disc instead of its region: the region is
// that of the visible part.
void ObjectSighter::measure_covered(const TargetView& view, const BallProjection& at, const MotionState& motion,
                                    Sighting& sighting) {
  const auto behind = outlines_.behind(static_cast<std::size_t>(view.index));
  const auto picture = behind ? picture_around(view, sighting.px) : std::nullopt;
  if (!picture) return;
  // A sample of chroma that the edge crosses has the object's colour: half of it lies outside.
  const double sample = sample_px(*view.image), radius_px = at.radius_px + sample / 2;
  const auto disc = covered_.measure(view, *picture, *behind, {sighting.px, radius_px});
  if (!disc) return;
  // The disc's radius is as uncertain as the distance: much so, where one view alone shows it.
  const Eigen::Vector3d ray = motion.position() - view.camera->centre();
  const double of_radius_px2 = at.radius_px * at.radius_px * ray.dot(motion.position_covariance() * ray) /
                               (ray.squaredNorm() * ray.squaredNorm());
  const BaseError base = base_error(at.radius_px, options_.pixel_noise_px, sample);
  const double bare_px = sighting_tuning.cut_error * disc->bare * radius_px;
  sighting.px = disc->px;
  sighting.covariance = disc->covariance + base.noise_px2 * Eigen::Matrix2d::Identity();
  sighting.bias_sigma_px = std::sqrt(base.bias_px2 + disc->covariance.trace() / 2 + of_radius_px2 + bare_px * bare_px);
}

// The object is part of a larger region, as in a hand of its colour: its outline alone is a measurement.
std::optional<Sighting> ObjectSighter::outline_of_merged(const TargetView& view, const MotionState& motion,
                                                         const ExpectedView& expected, const Eigen::Matrix2d& spread) {
  const BallProjection& at = expected.at;
  if (!view.camera->contains({at.px})) return std::nullopt;
  const double share = matching_share(*view.matches, at);
  if (share < sighting_tuning.start_disc_share) return std::nullopt;
  Sighting s;
  s.row = expected.row;
  s.camera = view.camera, s.projector = view.projector;
  s.px = at.px;
  s.covariance = spread + at.radius_px * at.radius_px * Eigen::Matrix2d::Identity();
  s.support = share;
  s.radius_px = at.radius_px;
  if (!outlines_.sharpen(view, motion, expected, spread, s)) return std::nullopt;
  return s;
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
                                       const MotionState& motion, double power_density, std::size_t least,
                                       std::vector<Sighting>& out) {
  const double reach_density = at_once_share * power_density;
  double dt = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    regions_[i].clear();
    const auto expected = expected_in(views[i], motion, radius_m_);
    if (!expected || last_[static_cast<std::size_t>(views[i].index)].is_repeated) continue;
    dt = std::max(dt, capture::seconds(expected->row.at - motion.at));
    const BallProjection& at = expected->at;
    const Eigen::Matrix3d spread = motion.seen_covariance(expected->row, reach_density);
    const auto near = regions_near(views[i], at, at.jacobian * spread * at.jacobian.transpose());
    regions_[i].assign(near.begin(), near.end());
  }
  const Eigen::Vector3d expected = motion.position() + dt * motion.velocity();
  const double reach_m =
      sighting_tuning.prediction_sigmas *
      (std::sqrt(reach_density * dt * dt * dt / 3) + std::sqrt(largest_variance(motion.position_covariance())));
  for (const PositionCandidate& c : cross_rays(views, std::span(regions_).first(views.size()), target, options_, motion,
                                               sighting_tuning.max_crossings)) {
    if ((c.position - expected).norm() > reach_m || c.sightings.size() <= least) continue;
    out = c.sightings;
    sort_by_time(out);
    return true;
  }
  return false;
}

}  // namespace huetrack::object_trackers
