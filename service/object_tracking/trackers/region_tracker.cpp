#include "object_tracking/trackers/region_tracker.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "calib/model/covariance_ellipse.h"
#include "object_tracking/trackers/estimate_report.h"

namespace huetrack::object_trackers {

using namespace object_tracking;
using namespace objects;

namespace {

bool is_live(const std::unique_ptr<TrackedObject>& object) {
  return object->state != TrackState::lost;
}

bool is_tracked(const std::unique_ptr<TrackedObject>& object) {
  return object->state == TrackState::tracking;
}

// Views enough for a position.
std::size_t views_needed(const std::vector<TargetView>& views) {
  return std::min<std::size_t>(2, views.size());
}

}  // namespace

RegionTracker::RegionTracker(const calib::CameraRig& rig, const TargetOptions& target,
                             const ObjectTrackerOptions& options, std::uint64_t stream)
    : rig_(rig),
      target_(target),
      options_(options),
      stream_(stream),
      views_(rig, target),
      sighter_(rig, target, options),
      search_(rig, target, options.volume),
      shared_(rig.cameras.size(), target, options),
      consistency_(rig.cameras.size(), target.radius_m, options),
      births_(target, options, looked_through(options)),
      rig_error_(rig, options.max_coast_sigma_m),
      clutter_mask_(rig.cameras.size(), target.count),
      clutter_(rig),
      search_log_(rig.cameras.size()),
      further_watch_(target, options),
      published_(target, options),
      times_(rig, target, options, particle_filter::Rng(options.seed, stream)),
      seen_regions_(options.pixel_noise_px) {
  for (std::size_t c = 0; c < rig.cameras.size(); ++c)
    clutter_mask_.set_sizes(c, search_.size_in_view(c).smallest_px, search_.size_in_view(c).largest_px,
                            rig.cameras[c].image_size);
}

void RegionTracker::update(const capture::FrameSet& set, std::vector<ObjectEstimate>& out) {
  const std::vector<TargetView>& views = views_.look_at(set);
  begin_set(set, views);
  measure(views_.unused(), &TrackedObject::watched);
  measure(views, &TrackedObject::sightings);
  compare_views(views, set.at);
  for (const auto& object : objects_) follow(*object, set, views);
  end_duplicates();
  search(set, views);
  last_at_ = set.at;
  published_.report(set, views_, consistency_, times_, objects_, out);
  std::erase_if(objects_, [&](const auto& object) {
    if (!is_live(object)) times_.adopt_times(object->filter);
    return !is_live(object);
  });
}

void RegionTracker::learn() {
  std::vector<Sighting> tracked;
  for (const auto& object : objects_) {
    tracked.insert(tracked.end(), object->sightings.begin(), object->sightings.end());
    if (clutter_mask_.is_room_shared()) add_expected(views_.used(), object->filter.motion(), target_.radius_m, tracked);
    if (!is_alone() || object->is_new) continue;
    sighter_.learn_behind(views_.used(), object->filter.motion());
    sighter_.learn_behind(views_.unused(), object->filter.motion());
  }
  const bool was_shared = clutter_mask_.is_room_shared();
  clutter_mask_.learn(views_.used(), tracked, last_at_);
  if (!was_shared && clutter_mask_.is_room_shared()) consistency_.forget();  // some of what was compared was the room
  if (!is_alone()) return;
  const auto object = std::ranges::find_if(objects_, is_tracked);
  if (object != objects_.end() && !clutter_mask_.is_room_shared())
    further_watch_.look(views_.used(), (*object)->sightings, (*object)->filter.motion(), search_, clutter_,
                        clutter_mask_, last_at_);
  else
    further_watch_.note_untracked(last_at_);
}

void RegionTracker::begin_set(const capture::FrameSet& set, const std::vector<TargetView>& views) {
  clutter_mask_.look(views, set.at);
  for (std::size_t c = 0; c < views_.camera_count(); ++c) consistency_.set_shared(c, clutter_mask_.is_shared(c));
  search_.set_shared(is_alone() && clutter_mask_.is_room_shared());
  seen_regions_.clear();
  sets_apart_ += is_apart(views) ? 1 : 0;
  if (set.at < last_at_) {  // the clock was set back: the states are of another time
    for (const auto& object : objects_) object->state = TrackState::lost;
    births_.forget();
  }
  if (!is_alone()) {
    std::vector<TimesHolder> holders;
    add_times_holders(holders);
    share_times(holders);
  }
  times_.motion().open_clocks(set);
  for (const auto& object : objects_) object->filter.motion().open_clocks(set);
}

void RegionTracker::measure(const std::vector<TargetView>& views, SightingsOf sightings) {
  if (!is_alone()) {
    shared_.measure(views, consistency_, search_, objects_, sightings);
  } else {
    for (const auto& object : objects_) {
      ((*object).*sightings).clear();
      if (is_live(object)) sighter_.sight(views, object->filter, consistency_, (*object).*sightings);
    }
  }
  for (const auto& object : objects_) clutter_mask_.mark_clipped((*object).*sightings);
}

// Of several objects by one, only where it is apart from all others: views of different objects are not inconsistent.
void RegionTracker::compare_views(const std::vector<TargetView>& views, capture::Timestamp set_at) {
  if (is_alone()) {
    for (const auto& object : objects_)
      if (is_live(object)) {
        object->existence.leave_out_chance(object->filter.motion(), object->filter.power_density(), views,
                                           target_.radius_m, clutter_, clutter_mask_, object->sightings);
        consistency_.compare(views, set_at, object->filter.motion(), object->sightings, object->watched, seen_regions_);
      }
    return;
  }
  lead_ = lead();
  if (lead_ != nullptr) {
    const auto which = std::ranges::find(objects_, lead_, &std::unique_ptr<TrackedObject>::get) - objects_.begin();
    const std::vector<Sighting> seen = shared_.alone(views, *lead_, std::size_t(which));
    for (const Sighting& s : seen) {
      const auto view = std::ranges::find(views, s.row.camera, &TargetView::index);
      if (!s.is_cut && view != views.end()) seen_regions_.add_target(*view, s);
    }
    if (!seen.empty()) consistency_.compare_sightings(lead_->filter.motion(), seen);
  }
  for (const auto& object : objects_) {
    consistency_.inflate(object->filter.motion(), object->sightings);
    consistency_.inflate(object->filter.motion(), object->watched);
  }
}

// The same one while it is tracked. While inflated covariances keep all objects from being tracked, one that is seen
// shows when that is over.
const TrackedObject* RegionTracker::lead() const {
  const auto is_seen = [](const auto& o) { return o->sightings.size() >= 2; };
  auto lead = std::ranges::find(objects_, lead_, &std::unique_ptr<TrackedObject>::get);
  if (lead != objects_.end() && is_tracked(*lead)) return lead->get();
  lead = std::ranges::find_if(objects_, [](const auto& o) { return o->is_published && is_tracked(o); });
  if (lead == objects_.end())
    lead = std::ranges::find_if(objects_, [&](const auto& o) { return o->is_published && is_seen(o); });
  if (lead == objects_.end()) lead = std::ranges::find_if(objects_, is_seen);
  return lead == objects_.end() ? nullptr : lead->get();
}

void RegionTracker::follow(TrackedObject& object, const capture::FrameSet& set, const std::vector<TargetView>& views) {
  if (object.state == TrackState::lost) return;
  object.is_new = false;
  object.seen = object.sightings;
  const double acceleration_before = object.filter.acceleration();
  double power_density = learn_acceleration(object, set, views);
  object.seen.insert(object.seen.end(), object.watched.begin(), object.watched.end());
  object.existence.update(set.at, object.filter.motion(), power_density, object.sightings, views, target_.radius_m,
                          clutter_, clutter_mask_);
  const auto chance = std::erase_if(object.sightings, [&](const Sighting& s) {
    return object.existence.is_chance(s.row.camera);  // clutter would lead the track away
  });
  if (chance > 0) {
    object.filter.set_acceleration(acceleration_before);
    object.filter.raise_acceleration(object.sightings);
    object.filter.settle_acceleration(object.sightings);
    power_density = object.filter.power_density();
  }
  for (Sighting& s : object.sightings) s.covariance += object.existence.chance_px2(s.row.camera);
  object.filter.update(object.sightings, set.at, object.last_published, power_density);
  if (!object.sightings.empty()) object.hidden_radii = hidden_error(object.sightings);
  judge(object, set);
}

// Returns the power density for this set. That of a bounce is not learnt: the motion after it is as calm as before.
double RegionTracker::learn_acceleration(TrackedObject& object, const capture::FrameSet& set,
                                         const std::vector<TargetView>& views) {
  ObjectFilter& filter = object.filter;
  const double before = filter.acceleration();
  filter.raise_acceleration(object.sightings);
  const double dt = capture::seconds(set.at - filter.motion().at);
  const bool is_unexplained = filter.is_unexplained(object.sightings);
  if (dt > 0 && views.size() >= 2 && (object.sightings.size() < 2 || is_unexplained)) {
    const double q = filter.kick_m_s() * filter.kick_m_s() / dt;
    if (measure_after_bounce(object, set, views, q) || is_unexplained) {
      filter.set_acceleration(before);
      return std::max(q, filter.power_density());
    }
  }
  filter.settle_acceleration(object.sightings);
  return filter.power_density();
}

// Regions of whole images need no other search. power_density: of the bounce.
bool RegionTracker::measure_after_bounce(TrackedObject& object, const capture::FrameSet& set,
                                         const std::vector<TargetView>& views, double power_density) {
  const MotionState& motion = object.filter.motion();
  if (!is_alone() ||
      !sighter_.sight_after_bounce(views, target_, motion, power_density, object.sightings.size(), object.sightings))
    return false;
  // Only these measurements fix the position now.
  const double dt = capture::seconds(set.at - motion.at);
  const PositionInformation seen = information_of(object.sightings, motion.position());
  const Eigen::Matrix3d covariance = seen.information.inverse();
  const Eigen::Vector3d position = covariance * seen.vector;
  if (position.allFinite()) {
    MotionState about = motion;
    about.begin(set.at, position, largest_variance(covariance), (position - motion.position()) / dt,
                power_density * dt);
    sighter_.sharpen(views, about, object.sightings);
    sort_by_time(object.sightings);
  }
  consistency_.inflate(motion, object.sightings);
  object.seen = object.sightings;
  return true;
}

// With one camera no other view sees where it goes.
bool RegionTracker::has_left_picture(const TrackedObject& object) const {
  if (rig_.cameras.size() > 1 || !object.sightings.empty() || views_.used().empty()) return false;
  const TargetView& view = views_.used().front();
  const auto expected = expected_in(view, object.filter.motion(), target_.radius_m);
  if (!expected) return true;
  const BallProjection& at = expected->at;
  const calib::ImageSize& size = view.camera->image_size;
  return at.px.x() < -at.radius_px || at.px.y() < -at.radius_px || at.px.x() > size.width - 1 + at.radius_px ||
         at.px.y() > size.height - 1 + at.radius_px;
}

// One object outside of the volume may come back; several are followed there. report() decides what is published.
void RegionTracker::judge(TrackedObject& object, const capture::FrameSet& set) {
  const MotionState& motion = object.filter.motion();
  const Judged now =
      judged(options_, object.filter, object.sightings, consistency_.inflated_sigma(motion, object.sightings),
             capture::seconds(set.at - object.last_tracking),
             !is_alone() || inside(options_.volume, motion, target_.radius_m));
  object.is_out_of_picture = has_left_picture(object);
  object.state = object.existence.is_refuted()                                      ? TrackState::lost
                 : now.state == TrackState::tracking && !object.existence.is_sure() ? TrackState::coasting
                                                                                    : now.state;
  if (now.is_seen) object.last_tracking = set.at;
}

// Of two tracks of one object, the one that more views see stays; of equal ones the older.
void RegionTracker::end_duplicates() {
  const double least_m = sighting_tuning.same_object_radii * target_.radius_m;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    for (std::size_t j = i + 1; j < objects_.size(); ++j) {
      TrackedObject &a = *objects_[i], &b = *objects_[j];
      // A coasting object's prediction may be where it cannot be.
      if (a.state != b.state || a.state == TrackState::lost) continue;
      if ((a.filter.motion().position() - b.filter.motion().position()).norm() > least_m) continue;
      const bool is_a_better = a.sightings.size() >= b.sightings.size();
      (is_a_better ? b : a).state = TrackState::lost;
    }
  }
}

void RegionTracker::search(const capture::FrameSet& set, const std::vector<TargetView>& views) {
  // A set of cameras of different rates neither confirms nor refutes.
  if (views.size() < std::min<std::size_t>(2, views_.camera_count())) return;
  if (is_alone()) {
    const auto tracked = std::ranges::find_if(objects_, is_tracked);
    if (tracked != objects_.end() && (!clutter_mask_.is_room_shared() || (*tracked)->existence.is_evident())) return;
    search_.look(views);
    for (std::size_t i = 0; i < views.size(); ++i)
      if (!seen_regions_.has(views[i].index)) seen_regions_.add_others(views[i], search_.regions()[i]);
    if (std::ranges::all_of(objects_, [](const auto& object) { return object->sightings.empty(); }))
      consistency_.compare_moving(views, search_.regions(), search_.usual_radii_px(views), set.at, times());
  }
  const std::vector<Birth> found = births(set, views);
  if (is_alone()) {
    for (const auto& object : objects_) {
      object->existence.compete(births_.best_evidence_besides(object->filter.motion().position()));
      if (is_tracked(object) && !object->existence.is_sure()) object->state = TrackState::coasting;
    }
  }
  for (const Birth& birth : found) begin_track(birth, views, set.at);
  if (std::ranges::any_of(objects_, is_live))
    search_log_.clear();
  else
    search_log_.add(views, search_.regions(), options_.volume, clutter_mask_.is_room_shared());
}

// One object is found inside of the volume only; several outside, too, so that they explain their regions.
std::vector<Birth> RegionTracker::births(const capture::FrameSet& set, const std::vector<TargetView>& views) {
  const auto regions = is_alone() ? search_.regions() : shared_.unexplained();
  std::vector<CoveredDisc> covered;
  for (const auto& object : objects_)
    add_covered(views, object->sightings, object->filter.motion().position(), target_.radius_m, covered);
  clutter_.look(views, regions);
  if (is_alone())
    for (const TargetView& view : views)
      if (clutter_.is_crowded(std::size_t(view.index))) clutter_mask_.note_crowded(std::size_t(view.index));
  std::vector<Birth> out = births_.look(views, regions, covered, clutter_, clutter_mask_, set.at, times());
  if (is_alone())
    std::erase_if(out, [&](const Birth& birth) { return !inside(options_.volume, birth.now, target_.radius_m); });
  for (const Birth& birth : out) clutter_.claim(birth.earlier.sightings);
  clutter_.add(views, regions);
  births_.claim(clutter_);
  for (const Birth& birth : out) clutter_.claim(birth.now.sightings);
  for (const auto& object : objects_) clutter_.claim(object->sightings);
  return out;
}

void RegionTracker::begin_track(const Birth& birth, const std::vector<TargetView>& views, capture::Timestamp set_at) {
  if (TrackedObject* coasting = coasting_to(birth, set_at)) return start(*coasting, birth, views, set_at);
  const bool is_taken = std::ranges::any_of(objects_, [&](const auto& o) {
    return is_live(o) && (o->filter.motion().position_at(set_at) - birth.now.position).norm() <
                             sighting_tuning.same_object_radii * target_.radius_m;
  });
  if (is_taken || !makes_room(birth, views, set_at)) return;
  auto fresh = std::make_unique<TrackedObject>(rig_, target_, options_,
                                               particle_filter::Rng(options_.seed, stream_ + started_++), rig_error_);
  fresh->filter.adopt_times(objects_.empty() ? times_ : objects_.front()->filter);
  if (!objects_.empty()) fresh->filter.motion().forget_unshared_times();
  start(*fresh, birth, views, set_at);
  if (!is_live(fresh)) times_.adopt_times(fresh->filter);
  if (is_live(fresh)) objects_.push_back(std::move(fresh));
}

// The coasting object that was detected, if any. One that was lost after the detection was first seen has bounced, or
// was caught: it may be wherever its speed, changed by as much, takes it.
TrackedObject* RegionTracker::coasting_to(const Birth& birth, capture::Timestamp set_at) const {
  TrackedObject* best = nullptr;
  double best_d2 = calib::chi2_999_in_3d;
  const double first_seen_s = 2 * birth.dt + 0.5 * birth.dt;  // ago, with half a set of slack
  for (const auto& object : objects_) {
    if (object->state != TrackState::coasting || object->sightings.size() >= views_needed(views_.used())) continue;
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
  return best;
}

// Two hypotheses of one object: the likelier one is tracked; of equal ones a track that is seen.
bool RegionTracker::makes_room(const Birth& birth, const std::vector<TargetView>& views, capture::Timestamp set_at) {
  const std::ptrdiff_t most = is_alone() ? 1 : 2 * TargetOptions::most_count;
  if (std::ranges::count_if(objects_, is_live) < most) return true;
  if (!is_alone()) return false;
  TrackedObject& before = **std::ranges::find_if(objects_, is_live);
  ObjectExistence found;
  found.begin(set_at, birth, views, target_.radius_m, options_, times(), clutter_, clutter_mask_);
  const double by_find = found.log_odds(), by_track = before.existence.log_odds();
  if (before.state != TrackState::coasting || by_find < by_track || (by_find == by_track && !before.sightings.empty()))
    return false;
  before.state = TrackState::lost;
  return true;
}

// The first initialisation gives the rows' times, and with them how consistent the views are. If they are not, it is
// repeated with inflated covariances: what the first sets claim would last for long.
void RegionTracker::start(TrackedObject& object, Birth birth, const std::vector<TargetView>& views,
                          capture::Timestamp set_at) {
  object.existence.begin(set_at, birth, views, target_.radius_m, options_, object.filter.motion(), clutter_,
                         clutter_mask_);
  if (is_alone()) {
    MotionState about = object.filter.motion();
    const double variance_m2 = largest_variance(birth.now.covariance);
    about.begin(set_at, birth.now.position, variance_m2, (birth.now.position - birth.earlier.position) / birth.dt,
                2 * variance_m2 / (birth.dt * birth.dt));
    sighter_.sharpen(views, about, birth.now.sightings);
  }
  const auto start_filter = [&] {
    object.sightings = object.filter.start(birth.earlier, birth.now, consistency_, set_at, birth.dt, sets_apart_ == 0,
                                           object.last_published);
  };
  const ObjectFilter before = object.filter;
  start_filter();
  for (Sighting& s : object.sightings) s.is_cut = s.is_cut || may_be_clutter(s, clutter_, clutter_mask_);
  if (lead_ == nullptr) consistency_.compare_found(object.filter.motion(), object.sightings);
  if (std::ranges::any_of(object.sightings, [](const Sighting& s) { return s.inflation_px2 > 0; })) {
    object.filter = before;
    start_filter();
  }
  object.seen = object.sightings;
  clutter_mask_.mark_clipped(object.sightings);
  object.state = judged_at_start(options_, object.filter, object.sightings,
                                 consistency_.inflated_sigma(object.filter.motion(), object.sightings),
                                 object.existence.is_sure());
  object.last_tracking = object.last_inside = set_at;
  object.is_new = true;
  object.hidden_radii = 0;
}

void RegionTracker::expected_outlines(std::size_t camera, std::vector<capture::ExpectedOutline>& out) const {
  if (!sighter_.outlines().is_enabled() || !is_alone()) return;
  const auto view = std::ranges::find(views_.used(), int(camera), &TargetView::index);
  if (view == views_.used().end()) return;
  for (const auto& object : objects_) {
    const auto expected = expected_in(*view, object->filter.motion(), target_.radius_m);
    if (!expected) continue;
    const Eigen::Vector2f px = expected->at.px.cast<float>();
    const Eigen::Vector2f velocity = (expected->at.jacobian * object->filter.motion().velocity()).cast<float>();
    out.push_back({.u = px.x(),
                   .v = px.y(),
                   .u_per_s = velocity.x(),
                   .v_per_s = velocity.y(),
                   .radius_px = float(expected->at.radius_px)});
  }
}

void RegionTracker::trust(std::span<const CameraTrust> cameras) {
  const std::vector<std::size_t> changed = views_.trust(cameras);
  for (const auto& object : objects_) {
    for (const std::size_t c : changed) object->filter.forget_camera(int(c));
    object->rig_error.exclude_poses(cameras);
  }
  rig_error_.exclude_poses(cameras);
  consistency_.trust(changed, cameras);
  for (const std::size_t c : changed) clutter_mask_.forget(c), clutter_.forget(c);
  if (!changed.empty()) births_.forget();
}

void RegionTracker::correct_times(std::span<const double> late_s) {
  times_.correct_times(late_s);
  for (const auto& object : objects_) object->filter.correct_times(late_s);
  consistency_.forget();
}

// Without an object, of the timing that the next one begins with.
void RegionTracker::add_times_holders(std::vector<TimesHolder>& out) {
  if (objects_.empty()) out.push_back({&times_, false});
  for (const auto& object : objects_) {
    const bool is_consistent =
        std::ranges::none_of(object->sightings, [](const Sighting& s) { return s.inflation_px2 > 0; });
    out.push_back({&object->filter, object->is_published && is_tracked(object) && is_consistent});
  }
}

// Of one camera the filter holds the object's size, too; nothing is learnt of its timing.
void RegionTracker::take_over_from(const RegionTracker& before) {
  published_.take_over_from(before.published_, before.objects_);
  if (rig_.cameras.size() > 1 && options_.timing == before.options_.timing)
    times_.adopt_times(before.objects_.empty() ? before.times_ : before.objects_.front()->filter);
}

void RegionTracker::begin_anew() {
  published_.end_all(objects_);
  for (const auto& object : objects_) times_.adopt_times(object->filter);
  objects_.clear();
  births_.forget();
}

PositionParticles RegionTracker::particles() const {
  PositionParticles all;
  for (const auto& object : objects_) {
    if (object->number == 0) continue;
    const PositionParticles& p = object->filter.particles();
    all.x.insert(all.x.end(), p.x.begin(), p.x.end());
    all.y.insert(all.y.end(), p.y.begin(), p.y.end());
    all.z.insert(all.z.end(), p.z.begin(), p.z.end());
  }
  return all.x.empty() ? times_.particles() : all;
}

// The timing's estimate. Until there is one, cameras with equal stamps count as synchronised: with open timing nearly
// any two rays would meet.
MotionState RegionTracker::times() const {
  MotionState out = objects_.empty() ? times_.motion() : objects_.front()->filter.motion();
  if (started_ == 0 && !times_.has_begun() && sets_apart_ == 0 && (!is_alone() || clutter_mask_.is_room_shared()))
    out.expect_synchronised();
  return out;
}

}  // namespace huetrack::object_trackers
