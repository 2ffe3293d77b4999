#include "object_tracking/trackers/shared_regions.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "object_tracking/expected_view.h"
#include "object_tracking/trackers/object_sighter.h"

namespace huetrack::object_trackers {

using namespace object_tracking;
using namespace objects;

namespace {

// A region this near may be the object in a camera that was turned: twice the largest extent of one object.
constexpr double elsewhere_radii = 2 * sighting_tuning.extent_radii;
// Regions are also searched here around an expected centre: half-way to where a part of the object may be.
constexpr double probe_radii = sighting_tuning.part_radii / 2;

// The visible rest of a known object that is mostly hidden.
std::vector<color::PixelAt> probes(std::span<const ExpectedObject> expected) {
  std::vector<color::PixelAt> out;
  for (const ExpectedObject& e : expected) {
    const double half = probe_radii * e.at.radius_px;
    for (const auto& [du, dv] : {std::pair(0.0, 0.0), {half, 0.0}, {-half, 0.0}, {0.0, half}, {0.0, -half}})
      out.push_back({int(std::lround(e.at.px.x() + du)), int(std::lround(e.at.px.y() + dv))});
  }
  return out;
}

}  // namespace

SharedRegions::SharedRegions(std::size_t cameras, const TargetOptions& target, const ObjectTrackerOptions& options)
    : radius_m_(target.radius_m),
      options_(options),
      association_(options.pixel_noise_px),
      expected_(cameras),
      unexplained_(cameras),
      last_(cameras) {}

void SharedRegions::measure(const std::vector<TargetView>& views, const ViewConsistency& agreement,
                            ObjectSearch& search, TrackedObjects& objects, SightingsOf sightings) {
  view_count_ = views.size();
  predict(views, agreement, objects);
  std::vector<std::vector<color::PixelAt>> also;
  for (std::size_t i = 0; i < views.size(); ++i) also.push_back(probes(expected_[i]));
  search.look(views, also);
  for (const auto& object : objects) ((*object).*sightings).clear();
  for (std::size_t i = 0; i < views.size(); ++i) {
    const std::vector<ExpectedObject>& expected = expected_[i];
    const std::vector<color::ColorRegion>& regions = search.regions()[i];
    unexplained_[i].clear();
    if (is_repeated(views[i], regions, expected)) continue;
    AssociatedSightings shared = association_.associate(views[i], regions, expected);
    for (std::size_t e = 0; e < expected.size(); ++e) {
      TrackedObject& object = *objects[expected[e].object];
      if (auto& s = shared.of_objects[e]) {
        s->row = row_of(views[i], s->px.y(), object.filter.motion());
        (object.*sightings).push_back(std::move(*s));
      }
    }
    for (std::size_t r = 0; r < regions.size(); ++r) {
      if (shared.is_explained[r] == 0) unexplained_[i].push_back(regions[r]);
    }
  }
  for (const auto& object : objects) sort_by_time((*object).*sightings);
}

void SharedRegions::predict(const std::vector<TargetView>& views, const ViewConsistency& agreement,
                            const TrackedObjects& objects) {
  for (std::size_t i = 0; i < views.size(); ++i) {
    const TargetView& view = views[i];
    expected_[i].clear();
    for (std::size_t o = 0; o < objects.size(); ++o) {
      if (objects[o]->state == TrackState::lost) continue;
      const ObjectFilter& filter = objects[o]->filter;
      const auto in_view = expected_in(view, filter.motion(), radius_m_);
      if (!in_view) continue;
      const BallProjection& at = in_view->at;
      const double margin = 2 * at.radius_px;
      if (!(at.px.x() > -margin && at.px.y() > -margin && at.px.x() < view.image->width + margin &&
            at.px.y() < view.image->height + margin))
        continue;
      expected_[i].push_back({o, at, predicted_spread(view, *in_view, filter, agreement, options_.acceleration_m_s2),
                              image_motion(view, at, filter.motion())});
    }
  }
}

// As ObjectSighter::is_repeated(), by all regions of the view.
bool SharedRegions::is_repeated(const TargetView& view, std::span<const color::ColorRegion> regions,
                                std::span<const ExpectedObject> expected) {
  LastRegions& last = last_[std::size_t(view.index)];
  const double since_s = capture::seconds(view.frame->captured_at - last.captured_at);
  const bool has_moved = std::ranges::any_of(expected, [&](const ExpectedObject& e) {
    return e.motion.velocity.norm() * since_s > sighting_tuning.same_place_px;
  });
  last.is_repeated =
      !last.is_repeated && has_moved && !regions.empty() &&
      std::ranges::equal(regions, last.regions, [](const color::ColorRegion& a, const color::ColorRegion& b) {
        return a.area == b.area && a.centre == b.centre;
      });
  last.regions.assign(regions.begin(), regions.end());
  last.captured_at = view.frame->captured_at;
  return last.is_repeated;
}

// The nearest unassigned region of its size, unless that is nearer to another object's prediction.
std::optional<Sighting> SharedRegions::elsewhere(const TargetView& view, std::size_t i, const TrackedObject& object,
                                                 std::size_t which) const {
  const auto own = std::ranges::find(expected_[i], which, &ExpectedObject::object);
  const bool is_seen =
      std::ranges::any_of(object.sightings, [&](const Sighting& s) { return s.row.camera == view.index; });
  if (is_seen || own == expected_[i].end() || last_[std::size_t(view.index)].is_repeated) return std::nullopt;
  const double disc = disc_area(own->at.radius_px);
  const color::ColorRegion* nearest = nullptr;
  double distance_px = elsewhere_radii * own->at.radius_px;
  for (const color::ColorRegion& region : unexplained_[i]) {
    const double off_px = (region.centre - own->at.px).norm();
    if (region.area < sighting_tuning.start_disc_share * disc || region.area > sighting_tuning.max_disc_share * disc ||
        off_px > distance_px)
      continue;
    const bool is_anothers = std::ranges::any_of(expected_[i], [&](const ExpectedObject& other) {
      return other.object != which && (region.centre - other.at.px).norm() < off_px;
    });
    if (!is_anothers) nearest = &region, distance_px = off_px;
  }
  if (nearest == nullptr) return std::nullopt;
  Sighting s = sighting_of(view, *nearest, own->at.radius_px, options_.pixel_noise_px, own->motion);
  s.row = row_of(view, s.px.y(), object.filter.motion());
  return s;
}

std::vector<Sighting> SharedRegions::alone(const std::vector<TargetView>& views, const TrackedObject& object,
                                           std::size_t which) const {
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto own = std::ranges::find(expected_[i], which, &ExpectedObject::object);
    if (own == expected_[i].end()) continue;
    for (const ExpectedObject& other : expected_[i]) {
      const double touching_px = own->at.radius_px + other.at.radius_px;
      if (other.object != which && (other.at.px - own->at.px).norm() < touching_px) return {};
    }
  }
  std::vector<Sighting> seen = object.sightings;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (auto s = elsewhere(views[i], i, object, which)) seen.push_back(std::move(*s));
  }
  return seen;
}

}  // namespace huetrack::object_trackers
