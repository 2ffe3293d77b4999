#include "object_tracking/trackers/many_tracker.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "calib/model/covariance_ellipse.h"
#include "object_tracking/trackers/estimate_report.h"
#include "object_tracking/trackers/object_sighter.h"

namespace huetrack::object_trackers {

using namespace object_tracking;
using namespace objects;

namespace {

struct ManyTrackerTuning {
  double elsewhere_radii = 6;  // a region this near may be the object in a camera that was turned (experiment)
  double apart_radii = 2;      // of both discs: further apart, no region is of two objects
  double probe_radii = 0.6;    // regions are also searched here around an expected centre (experiment)
  double longest_outside_of_coast = 0.5;  // an object outside of the volume ends after this share of coast_s
};
constexpr ManyTrackerTuning many_tracker{};

}  // namespace

ManyTracker::ManyTracker(const calib::CameraRig& rig, const TargetOptions& target, const ObjectTrackerOptions& options,
                         std::uint64_t stream)
    : rig_(rig),
      target_(target),
      options_(options),
      stream_(stream),
      views_(rig, target),
      association_(options.pixel_noise_px),
      consistency_(rig.cameras.size(), target.radius_m, options),
      births_(target, options, looked_through(options.volume)),
      clutter_mask_(rig.cameras.size(), target.count),
      clutter_(rig),
      search_log_(rig.cameras.size()),
      times_(rig, target, options, particle_filter::Rng(options.seed, stream)),
      finders_(rig.cameras.size()),
      expected_(rig.cameras.size()),
      regions_(rig.cameras.size()),
      unexplained_(rig.cameras.size()),
      last_regions_(rig.cameras.size()),
      seen_regions_(options.pixel_noise_px) {
  for (const calib::Camera& camera : rig.cameras)
    size_in_view_.push_back(size_in(camera, options.volume, target.radius_m));
  for (std::size_t c = 0; c < rig.cameras.size(); ++c)
    clutter_mask_.set_sizes(c, size_in_view_[c].smallest_px, size_in_view_[c].largest_px, rig.cameras[c].image_size);
}

void ManyTracker::update(const capture::FrameSet& set, std::vector<ObjectEstimate>& out) {
  const std::vector<TargetView>& views = views_.look_at(set);
  seen_regions_.clear();
  clutter_mask_.look(views, set.at);
  sets_apart_ += is_apart(views) ? 1 : 0;
  if (set.at < last_at_) forget_all();  // the clock was set back: the states are of another time
  times_.motion().open_clocks(set);
  for (const auto& object : objects_) object->filter.motion().open_clocks(set);
  if (!views_.unused().empty()) {
    predict(views_.unused());
    find_regions(views_.unused());
    associate(views_.unused(), &Object::watched);
  }
  predict(views);
  find_regions(views);
  associate(views, &Object::sightings);
  compare_views(views);
  for (const auto& object : objects_) follow(*object, set, views);
  end_duplicates();
  if (views.size() >= std::min<std::size_t>(2, rig_.cameras.size())) note_births(set, views);
  last_at_ = set.at;
  report(set, out);
}

void ManyTracker::learn() {
  std::vector<Sighting> tracked;
  for (const auto& object : objects_) tracked.insert(tracked.end(), object->sightings.begin(), object->sightings.end());
  for (const auto& object : objects_) {
    if (clutter_mask_.is_room_shared()) add_expected(views_.used(), object->filter.motion(), target_.radius_m, tracked);
  }
  clutter_mask_.learn(views_.used(), tracked, last_at_);
}

void ManyTracker::predict(const std::vector<TargetView>& views) {
  for (std::size_t i = 0; i < views.size(); ++i) {
    const TargetView& view = views[i];
    expected_[i].clear();
    for (std::size_t o = 0; o < objects_.size(); ++o) {
      const ObjectFilter& filter = objects_[o]->filter;
      const MotionState& motion = filter.motion();
      const auto in_view = expected_in(view, motion, target_.radius_m);
      if (!in_view) continue;
      const BallProjection& at = in_view->at;
      const double margin = 2 * at.radius_px;
      if (!(at.px.x() > -margin && at.px.y() > -margin && at.px.x() < view.image->width + margin &&
            at.px.y() < view.image->height + margin))
        continue;
      expected_[i].push_back({o, at, predicted_spread(view, *in_view, filter, consistency_, options_.acceleration_m_s2),
                              image_motion(view, at, motion)});
    }
  }
}

void ManyTracker::find_regions(const std::vector<TargetView>& views) {
  std::vector<color::PixelAt> also;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto camera = static_cast<std::size_t>(views[i].index);
    const SizeInView& size = size_in_view_[camera];
    regions_[i].clear();
    if (size.largest_px == 0) continue;  // no part of the volume is in view
    // Also the visible rest of a known object that is mostly hidden.
    also.clear();
    for (const ExpectedObject& e : expected_[i]) {
      const double half = many_tracker.probe_radii * e.at.radius_px;
      for (const auto& [du, dv] : {std::pair(0.0, 0.0), {half, 0.0}, {-half, 0.0}, {0.0, half}, {0.0, -half}})
        also.push_back(
            {static_cast<int>(std::lround(e.at.px.x() + du)), static_cast<int>(std::lround(e.at.px.y() + dv))});
    }
    regions_[i] = whole_regions(finders_[camera], *views[i].matches, size, target_.count, also);
  }
}

// As ObjectSighter::is_repeated(), by all regions of the view.
bool ManyTracker::is_repeated(const TargetView& view, std::span<const color::ColorRegion> regions,
                              std::span<const ExpectedObject> expected) {
  LastRegions& last = last_regions_[static_cast<std::size_t>(view.index)];
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

void ManyTracker::associate(const std::vector<TargetView>& views, std::vector<Sighting> Object::*sightings) {
  for (const auto& object : objects_) (*object.*sightings).clear();
  for (std::size_t i = 0; i < views.size(); ++i) {
    const TargetView& view = views[i];
    const std::vector<ExpectedObject>& expected = expected_[i];
    unexplained_[i].clear();
    if (is_repeated(view, regions_[i], expected)) continue;
    AssociatedSightings shared = association_.associate(view, regions_[i], expected);
    for (std::size_t e = 0; e < expected.size(); ++e) {
      Object& object = *objects_[expected[e].object];
      if (auto& s = shared.of_objects[e]) {
        s->row = row_of(view, s->px.y(), object.filter.motion());
        (object.*sightings).push_back(std::move(*s));
      }
    }
    for (std::size_t r = 0; r < regions_[i].size(); ++r) {
      if (shared.is_explained[r] == 0) unexplained_[i].push_back(regions_[i][r]);
    }
  }
  for (const auto& object : objects_) {
    clutter_mask_.mark_clipped(*object.*sightings);
    sort_by_time(*object.*sightings);
  }
}

// For a view that does not show the object where it is predicted: the nearest unassigned region of its size, unless
// that is nearer to another object's prediction. In a camera that was turned it is the object.
std::optional<Sighting> ManyTracker::seen_elsewhere(const TargetView& view, std::size_t i, std::size_t which) const {
  const auto own = std::ranges::find(expected_[i], which, &ExpectedObject::object);
  const bool is_seen =
      std::ranges::any_of(objects_[which]->sightings, [&](const Sighting& s) { return s.row.camera == view.index; });
  if (is_seen || own == expected_[i].end() || last_regions_[static_cast<std::size_t>(view.index)].is_repeated)
    return std::nullopt;
  const double disc = std::numbers::pi * own->at.radius_px * own->at.radius_px;
  const color::ColorRegion* nearest = nullptr;
  double distance_px = many_tracker.elsewhere_radii * own->at.radius_px;
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
  s.row = row_of(view, s.px.y(), objects_[which]->filter.motion());
  return s;
}

// By one object, the same one while it is tracked, and only where it is apart from all others: views of different
// objects are not inconsistent.
void ManyTracker::compare_views(const std::vector<TargetView>& views) {
  const auto is_lead = [&](const auto& object) { return object.get() == lead_; };
  auto lead = std::ranges::find_if(objects_, is_lead);
  if (lead == objects_.end() || (*lead)->state != TrackState::tracking) {
    lead = std::ranges::find_if(objects_,
                                [](const auto& o) { return o->is_published && o->state == TrackState::tracking; });
    // While inflated covariances keep all objects from being tracked, one that is seen shows when that is over.
    if (lead == objects_.end())
      lead = std::ranges::find_if(objects_, [](const auto& o) { return o->is_published && o->sightings.size() >= 2; });
    if (lead == objects_.end())
      lead = std::ranges::find_if(objects_, [](const auto& o) { return o->sightings.size() >= 2; });
    lead_ = lead == objects_.end() ? nullptr : lead->get();
  }
  if (lead_ == nullptr) return;
  Object& object = **lead;
  const auto which = static_cast<std::size_t>(lead - objects_.begin());
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto own = std::ranges::find(expected_[i], which, &ExpectedObject::object);
    if (own == expected_[i].end()) continue;
    for (const ExpectedObject& other : expected_[i]) {
      const double apart_px = many_tracker.apart_radii * (own->at.radius_px + other.at.radius_px);
      if (other.object != which && (other.at.px - own->at.px).norm() < apart_px) return;
    }
  }
  std::vector<Sighting> seen = object.sightings;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (auto elsewhere = seen_elsewhere(views[i], i, which)) seen.push_back(std::move(*elsewhere));
  }
  for (const Sighting& s : seen) {
    const auto view = std::ranges::find(views, s.row.camera, &TargetView::index);
    if (!s.is_cut && view != views.end()) seen_regions_.add_target(*view, s);
  }
  consistency_.compare_sightings(object.filter.motion(), seen);
}

// Returns the power density for this set. That of a bounce is not learnt: the motion after it is as calm as before.
double ManyTracker::learn_acceleration(Object& object, const capture::FrameSet& set) {
  ObjectFilter& filter = object.filter;
  const double before = filter.acceleration();
  filter.raise_acceleration(object.sightings);
  const double dt = capture::seconds(set.at - filter.motion().at);
  if (dt > 0 && filter.is_unexplained(object.sightings)) {
    const double kick = filter.kick_m_s();
    filter.set_acceleration(before);
    return std::max(kick * kick / dt, filter.power_density());
  }
  filter.settle_acceleration(object.sightings);
  return filter.power_density();
}

void ManyTracker::follow(Object& object, const capture::FrameSet& set, const std::vector<TargetView>& views) {
  consistency_.inflate(object.filter.motion(), object.sightings);
  consistency_.inflate(object.filter.motion(), object.watched);
  const double power_density = learn_acceleration(object, set);
  object.existence.update(set.at, object.filter.motion(), power_density, object.sightings, views, target_.radius_m,
                          clutter_, clutter_mask_);
  object.filter.update(object.sightings, set.at, object.last_published, power_density);
  judge(object, set);
}

// Also of an object outside of the volume: report() decides what is published.
void ManyTracker::judge(Object& object, const capture::FrameSet& set) {
  const MotionState& motion = object.filter.motion();
  const Judged now =
      judged(options_, object.filter, object.sightings, consistency_.inflated_sigma(motion, object.sightings),
             capture::seconds(set.at - object.last_tracking), true);
  object.state = object.existence.is_refuted()                                      ? TrackState::lost
                 : now.state == TrackState::tracking && !object.existence.is_sure() ? TrackState::coasting
                                                                                    : now.state;
  if (now.is_seen) object.last_tracking = set.at;
}

// Of two tracks of one object, the one that more views see stays; of equal ones the older.
void ManyTracker::end_duplicates() {
  const double least_m = sighting_tuning.same_object_radii * target_.radius_m;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    for (std::size_t j = i + 1; j < objects_.size(); ++j) {
      Object &a = *objects_[i], &b = *objects_[j];
      if (a.state == TrackState::lost || b.state == TrackState::lost) continue;
      if ((a.filter.motion().position() - b.filter.motion().position()).norm() > least_m) continue;
      // A coasting object's prediction may be where it cannot be.
      if (a.state == TrackState::tracking && b.state == TrackState::coasting) continue;
      if (b.state == TrackState::tracking && a.state == TrackState::coasting) continue;
      const bool is_a_better = a.sightings.size() >= b.sightings.size();
      (is_a_better ? b : a).state = TrackState::lost;
    }
  }
}

void ManyTracker::note_births(const capture::FrameSet& set, const std::vector<TargetView>& views) {
  std::vector<CoveredDisc> covered;
  for (const auto& object : objects_) {
    for (const Sighting& s : object->sightings) {
      for (std::size_t v = 0; v < views.size(); ++v)
        if (views[v].index == s.row.camera)
          covered.push_back({v, s.px,
                             project_ball(*s.camera, object->filter.motion().position(), target_.radius_m)
                                 .value_or(BallProjection{})
                                 .radius_px});
    }
  }
  const std::vector<Birth> births = births_.look(views, std::span(unexplained_).first(views.size()), covered, clutter_,
                                                 clutter_mask_, set.at, times());
  for (const Birth& birth : births) clutter_.claim(birth.earlier.sightings);
  clutter_.add(views, std::span(unexplained_).first(views.size()));
  for (const Birth& birth : births) clutter_.claim(birth.now.sightings);
  for (const Birth& birth : births) {
    if (continue_track(birth, views, set.at)) continue;
    const bool is_taken = std::ranges::any_of(objects_, [&](const auto& o) {
      return o->state != TrackState::lost && (o->filter.motion().position_at(set.at) - birth.now.position).norm() <
                                                 sighting_tuning.same_object_radii * target_.radius_m;
    });
    if (is_taken || std::ssize(objects_) >= 2 * TargetOptions::most_count) continue;
    auto fresh =
        std::make_unique<Object>(rig_, target_, options_, particle_filter::Rng(options_.seed, stream_ + ++started_));
    fresh->filter.adopt_times(objects_.empty() ? times_ : objects_.front()->filter);
    start(*fresh, birth, views, set.at);
    if (fresh->state != TrackState::lost) objects_.push_back(std::move(fresh));
  }
  if (objects_.empty()) search_log_.add(views, std::span(regions_).first(views.size()), options_.volume);
}

// Whether a detection is a coasting object. One that was lost after the detection was first seen has bounced, or was
// caught: it may be wherever its speed, changed by as much, takes it.
bool ManyTracker::continue_track(const Birth& birth, const std::vector<TargetView>& views, capture::Timestamp set_at) {
  Object* best = nullptr;
  double best_d2 = calib::chi2_999_in_3d;
  const double first_seen_s = 2 * birth.dt + 0.5 * birth.dt;  // ago, with half a set of slack
  for (const auto& object : objects_) {
    if (object->state != TrackState::coasting || object->sightings.size() >= 2) continue;
    const MotionState& motion = object->filter.motion();
    const Eigen::Vector3d d = birth.now.position - motion.position_at(set_at);
    Eigen::Matrix3d s = motion.position_covariance() + birth.now.covariance +
                        target_.radius_m * target_.radius_m * Eigen::Matrix3d::Identity();
    const double lost_s = capture::seconds(set_at - object->last_tracking);
    const double way_m = object->filter.kick_m_s() * lost_s;
    if (lost_s < first_seen_s && d.norm() < way_m) s.diagonal().array() += way_m * way_m;
    const double d2 = d.dot(s.inverse() * d);
    if (d2 < best_d2) best_d2 = d2, best = object.get();
  }
  if (best == nullptr) return false;
  start(*best, birth, views, set_at);
  return true;
}

void ManyTracker::start(Object& object, const Birth& birth, const std::vector<TargetView>& views,
                        capture::Timestamp set_at) {
  object.existence.begin(set_at, birth, views, target_.radius_m, options_, object.filter.motion(), clutter_,
                         clutter_mask_);
  object.sightings = object.filter.start(birth.earlier, birth.now, consistency_, set_at, birth.dt, sets_apart_ == 0,
                                         object.last_published);
  if (lead_ == nullptr) consistency_.compare_found(object.filter.motion(), object.sightings);
  object.state = judged_at_start(options_, object.filter, object.sightings,
                                 consistency_.inflated_sigma(object.filter.motion(), object.sightings),
                                 object.existence.is_sure());
  object.last_tracking = set_at;
}

void ManyTracker::forget_all() {
  for (const auto& object : objects_) object->state = TrackState::lost;
  births_.forget();
}

void ManyTracker::trust(std::span<const CameraTrust> cameras) {
  const std::vector<std::size_t> changed = views_.trust(cameras);
  for (const auto& object : objects_) {
    for (const std::size_t c : changed) object->filter.forget_camera(static_cast<int>(c));
    object->rig_error.exclude_poses(cameras);
  }
  consistency_.trust(changed, cameras);
  for (const std::size_t c : changed) clutter_mask_.forget(c), clutter_.forget(c);
  if (!changed.empty()) births_.forget();
}

void ManyTracker::correct_times(std::span<const double> late_s) {
  times_.correct_times(late_s);
  for (const auto& object : objects_) object->filter.correct_times(late_s);
  consistency_.forget();
}

void ManyTracker::begin_anew() {
  for (const auto& object : objects_) {
    times_.adopt_times(object->filter);
    if (object->is_published) ended_.push_back(object->number);
  }
  objects_.clear();
  births_.forget();
  number_before_ = last_number_;
}

// Subscribers know objects by their numbers alone, so a number ends with its tracker and is not used again.
void ManyTracker::take_over_from(const ManyTracker& before) {
  number_before_ = last_number_ = before.last_number_;
  ended_ = before.ended_;
  for (const auto& object : before.objects_)
    if (object->is_published) ended_.push_back(object->number);
}

PositionParticles ManyTracker::particles() const {
  PositionParticles all;
  for (const auto& object : objects_) {
    if (object->number == 0) continue;
    const PositionParticles& p = object->filter.particles();
    all.x.insert(all.x.end(), p.x.begin(), p.x.end());
    all.y.insert(all.y.end(), p.y.begin(), p.y.end());
    all.z.insert(all.z.end(), p.z.begin(), p.z.end());
  }
  return all;
}

// The timing's estimate. Until there is one, cameras with equal stamps count as synchronised: with open timing nearly
// any two rays would meet.
MotionState ManyTracker::times() const {
  MotionState out = objects_.empty() ? times_.motion() : objects_.front()->filter.motion();
  if (started_ == 0 && sets_apart_ == 0) out.expect_synchronised();
  return out;
}

void ManyTracker::report(const capture::FrameSet& set, std::vector<ObjectEstimate>& out) {
  out.clear();
  report_ended(set, out);
  std::vector<Sighting> seen;  // also of cameras that are not used
  std::optional<Eigen::Vector3d> further_at;
  auto published = std::ranges::count_if(objects_, [](const auto& o) { return o->is_published; });
  for (const auto& object : objects_) {
    const bool is_inside = inside(options_.volume, object->filter.motion().position(), target_.radius_m);
    if (is_inside) object->last_inside = set.at;
    const bool is_birth = !object->is_published;
    if (is_birth) {
      if (object->state != TrackState::tracking || !is_inside) continue;
      if (published >= target_.count) {
        further_at = object->filter.motion().position();
        continue;
      }
      ++published;
      object->is_published = true;
      object->number = ++last_number_;
    }
    const bool is_end =
        object->state == TrackState::lost ||
        capture::seconds(set.at - object->last_inside) > many_tracker.longest_outside_of_coast * options_.coast_s;
    seen = object->sightings;
    seen.insert(seen.end(), object->watched.begin(), object->watched.end());
    const TrackState state = is_end ? TrackState::lost : is_inside ? object->state : TrackState::coasting;
    out.push_back(object_trackers::report({.set = set,
                                           .views = views_,
                                           .radius_m = target_.radius_m,
                                           .options = options_,
                                           .state = state,
                                           .filter = object->filter,
                                           .agreement = consistency_,
                                           .sightings = object->sightings,
                                           .seen = seen},
                                          object->rig_error, object->last_published));
    out.back().object = object->number;
    out.back().is_birth = is_birth;
    out.back().is_end = is_end;
    if (is_end) object->is_published = false;  // outside it is still followed; when it comes in it gets a new number
  }
  further_.note(set.at, further_at);
  std::ranges::sort(out, {}, &ObjectEstimate::object);
  std::erase_if(objects_, [&](const auto& object) {
    if (object->state == TrackState::lost) times_.adopt_times(object->filter);
    return object->state == TrackState::lost;
  });
  if (out.empty())
    out.push_back(no_object(set));
  else
    search_log_.clear();
}

void ManyTracker::report_ended(const capture::FrameSet& set, std::vector<ObjectEstimate>& out) {
  for (const std::uint32_t number : ended_) {
    out.push_back(without_position(set, views_, times_.motion(), TrackState::lost));
    out.back().object = number;
    out.back().is_end = true;
  }
  ended_.clear();
}

// One estimate, of the target itself.
ObjectEstimate ManyTracker::no_object(const capture::FrameSet& set) const {
  const bool was_found = last_number_ != number_before_;
  return without_position(set, views_, times_.motion(), was_found ? TrackState::lost : TrackState::searching);
}

}  // namespace huetrack::object_trackers
