#include "object_tracking/trackers/region_tracker.h"

#include <algorithm>
#include <cmath>

#include "object_tracking/trackers/estimate_report.h"

namespace huetrack::object_trackers {

using namespace object_tracking;
using namespace objects;

namespace {

// Does it show whole discs of its size in two views? An outline is as round as the disc that was fitted to it, whatever
// is there.
bool shows_discs(std::span<const Sighting> sightings) {
  return std::ranges::count_if(sightings, [](const Sighting& s) { return !s.is_outline && is_unoccluded_disc(s); }) >= 2;
}

}  // namespace

RegionTracker::RegionTracker(const calib::CameraRig& rig, const TargetOptions& target,
                             const ObjectTrackerOptions& options, particle_filter::Rng rng)
    : target_(target),
      options_(options),
      views_(rig, target),
      sighter_(rig, target, options),
      consistency_(rig.cameras.size(), target.radius_m, options),
      filter_(rig, target.radius_m, options, rng),
      search_(rig, target, options),
      rig_error_(rig, options.max_coast_sigma_m),
      clutter_mask_(rig.cameras.size(), 1),
      clutter_(rig),
      further_(target, options, search_.sizes_in_view()) {
  for (std::size_t c = 0; c < rig.cameras.size(); ++c)
    clutter_mask_.set_sizes(c, search_.size_in_view(c).smallest_px, search_.size_in_view(c).largest_px,
                           rig.cameras[c].image_size);
}

ObjectEstimate RegionTracker::update(const capture::FrameSet& set) {
  const std::vector<TargetView>& views = views_.look_at(set);
  seen_ = sightings_;  // of the last set
  if (clutter_mask_.is_room_shared() && (state_ == TrackState::tracking || state_ == TrackState::coasting))
    add_expected(views, filter_.belief(), target_.radius_m, seen_);
  clutter_mask_.look(views, seen_, set.at);
  for (std::size_t c = 0; c < views_.camera_count(); ++c) consistency_.set_shared(c, clutter_mask_.is_shared(c));
  search_.set_shared(clutter_mask_.is_room_shared(), must_move(clutter_mask_, set.at));
  sightings_.clear();
  seen_.clear();
  watched_.clear();
  seen_regions_.clear();
  sets_apart_ += is_apart(views) ? 1 : 0;
  if (set.at < last_at_) forget();  // the clock was put back: what was known is of another time
  filter_.belief().open_clocks(set);
  if (state_ == TrackState::tracking || state_ == TrackState::coasting) {
    sighter_.sight(views, filter_, consistency_, sightings_);  // colour regions near the prediction, one per view at most
    sighter_.sight(views_.unused(), filter_, consistency_, watched_);
    clutter_mask_.mark_clipped(sightings_);
    consistency_.compare(views, set.at, filter_.belief(), sightings_, watched_, seen_regions_);
    seen_ = sightings_;
    seen_.insert(seen_.end(), watched_.begin(), watched_.end());
    const double acceleration_before = filter_.acceleration();
    double power_density = learn_acceleration(set, views);
    weigh_existence(set.at, power_density, views);
    if (existence_.is_chance()) {  // followed, furniture would lead it away
      sightings_.clear();
      filter_.set_acceleration(acceleration_before);
      power_density = filter_.power_density();
    }
    filter_.update(sightings_, set.at, last_reported_, power_density);
    judge(set);
    if (state_ == TrackState::tracking || state_ == TrackState::coasting) {
      sighter_.learn_behind(views, filter_.belief());
      sighter_.learn_behind(views_.unused(), filter_.belief());
    }
  }
  if (state_ != TrackState::tracking) search(set, views);
  if (state_ == TrackState::tracking && !clutter_mask_.is_room_shared())
    further_.look(views, sightings_, filter_.belief(), clutter_mask_, set.at);
  else
    further_.note_untracked(set.at);
  last_at_ = set.at;
  return report(set);
}

void RegionTracker::expected_outlines(std::size_t camera, std::vector<capture::ExpectedOutline>& out) const {
  if (!sighter_.outlines().is_enabled() || (state_ != TrackState::tracking && state_ != TrackState::coasting)) return;
  const auto view = std::ranges::find(views_.used(), static_cast<int>(camera), &TargetView::index);
  if (view == views_.used().end()) return;
  const auto expected = expected_in(*view, filter_.belief(), target_.radius_m);
  if (!expected) return;
  const Eigen::Vector2f px = expected->at.px.cast<float>();
  const Eigen::Vector2f velocity = (expected->at.jacobian * filter_.belief().velocity()).cast<float>();
  out.push_back({.u = px.x(),
                 .v = px.y(),
                 .u_per_s = velocity.x(),
                 .v_per_s = velocity.y(),
                 .radius_px = static_cast<float>(expected->at.radius_px)});
}

void RegionTracker::trust(std::span<const CameraTrust> cameras) {
  const std::vector<std::size_t> changed = views_.trust(cameras);
  for (const std::size_t c : changed) filter_.forget_camera(static_cast<int>(c)), clutter_mask_.forget(c);
  consistency_.trust(changed, cameras);
  rig_error_.exclude_poses(cameras);
}

void RegionTracker::correct_times(std::span<const double> late_s) {
  filter_.correct_times(late_s);
  consistency_.forget();
}

void RegionTracker::distrust_color(capture::Timestamp set_at) {
  if (state_ == TrackState::tracking || state_ == TrackState::coasting) forget();
  sightings_.clear();
  clutter_mask_.suspect_room(set_at);
}

// Returns the power density to use for this set: a bounce needs one that is not learnt, as what comes after it is as
// calm as what went before.
double RegionTracker::learn_acceleration(const capture::FrameSet& set, const std::vector<TargetView>& views) {
  const double before = filter_.acceleration();
  filter_.raise_acceleration(sightings_);
  const MotionState& belief = filter_.belief();
  const double dt = capture::seconds(set.at - belief.at);
  const bool is_unexplained = filter_.is_unexplained(sightings_);
  if (dt > 0 && views.size() >= 2 && (sightings_.size() < 2 || is_unexplained)) {
    const double kick = filter_.kick_m_s();
    const double q = kick * kick / dt;
    const bool is_seen = sighter_.sight_after_bounce(views, target_, belief, q, sightings_.size(), sightings_);
    if (is_seen) {
      // Where it is now, nobody knows but they.
      const PositionInformation seen = information_of(sightings_, belief.position());
      const Eigen::Matrix3d covariance = seen.information.inverse();
      const Eigen::Vector3d position = covariance * seen.vector;
      if (position.allFinite()) {
        MotionState about = belief;
        about.begin(set.at, position, largest_variance(covariance), (position - belief.position()) / dt, kick * kick);
        sighter_.sharpen(views, about, sightings_);
        sort_by_time(sightings_);
      }
      consistency_.inflate(belief, sightings_);
      seen_ = sightings_;
    }
    if (is_seen || is_unexplained) {
      filter_.set_acceleration(before);
      return std::max(q, filter_.power_density());
    }
  }
  filter_.settle_acceleration(sightings_);
  return filter_.power_density();
}

void RegionTracker::forget() {
  if (state_ != TrackState::searching) state_ = TrackState::lost;
  search_.forget();
  filter_.scatter();
}

void RegionTracker::weigh_existence(capture::Timestamp set_at, double power_density,
                                    const std::vector<TargetView>& views) {
  if (!clutter_mask_.is_room_shared()) return existence_.assume();
  existence_.update(set_at, filter_.belief(), power_density, sightings_, views, target_.radius_m, clutter_,
                    clutter_mask_);
}

void RegionTracker::judge(const capture::FrameSet& set) {
  const MotionState& belief = filter_.belief();
  const Judged now = judged(options_, belief, sightings_, consistency_.inflated_sigma(belief, sightings_),
                            capture::seconds(set.at - last_tracking_),
                            // What has left the volume may turn back, and is not told to be there.
                            inside(options_.volume, belief.position(), target_.radius_m));
  if (now.state == TrackState::lost || existence_.is_refuted()) return forget();
  state_ = existence_.is_sure() ? now.state : TrackState::coasting;
  if (now.is_seen) last_tracking_ = set.at;
}

void RegionTracker::search(const capture::FrameSet& set, const std::vector<TargetView>& views) {
  if (views.size() < 2) return;  // of cameras of different rates: such a set neither confirms nor refutes
  search_.look(views);
  for (std::size_t i = 0; i < views.size(); ++i)
    if (!seen_regions_.has(views[i].index)) seen_regions_.add_others(views[i], search_.regions()[i]);
  if (sightings_.empty()) {
    consistency_.compare_moving(views, search_.regions(), search_.usual_radii_px(views), set.at, filter_.belief());
  }
  const bool is_shared = clutter_mask_.is_room_shared();
  if (is_shared) clutter_.add(views, search_.regions());
  // Before anything is known of the cameras' times, frames of the same times are of cameras that are triggered
  // together: among the regions of a room nearly any two rays would meet otherwise.
  MotionState times = filter_.belief();
  if (is_shared && sets_apart_ == 0 && last_tracking_ == capture::Timestamp{}) times.expect_synchronised();
  auto find = search_.find(views, set.at, times, clutter_mask_);
  if (!find) {
    finds_out_of_reach_ = 0;
    return;
  }
  // It is what is followed already, and not sure yet.
  if (is_shared && state_ == TrackState::coasting && sightings_.size() >= 2 &&
      (find->now.position - filter_.belief().position()).norm() < 1.5 * target_.radius_m)
    return;
  if (is_out_of_reach(*find, set.at)) return;
  MotionState about = filter_.belief();
  const double variance_m2 = std::pow(largest_sigma(find->now.covariance), 2);
  about.begin(set.at, find->now.position, variance_m2, (find->now.position - find->earlier.position) / find->dt,
              2 * variance_m2 / (find->dt * find->dt));
  sighter_.sharpen(views, about, find->now.sightings);
  if (is_shared)
    existence_.begin(set.at, *find, views, target_.radius_m, (options_.volume.max - options_.volume.min).maxCoeff(),
                     options_, clutter_, clutter_mask_);
  else
    existence_.assume();
  start_compared(*find, set.at);
  const double doubted_m = consistency_.inflated_sigma(filter_.belief(), sightings_);
  if (doubted_m <= options_.max_coast_sigma_m) {
    const double sigma_m = std::max(judged_sigma(filter_.belief(), sightings_), doubted_m);
    const bool is_told = existence_.is_sure() && is_somewhere(options_, filter_.belief()) &&
                         sigma_m <= options_.max_tracking_sigma_m &&
                         inside(options_.volume, filter_.belief().position(), target_.radius_m);
    state_ = is_told ? TrackState::tracking : TrackState::coasting;
    last_tracking_ = set.at;
    search_.found();
    return;
  }
  sightings_.clear();  // views that contradict one another so much have found nothing
  seen_.clear();
  if (state_ == TrackState::coasting) {
    state_ = TrackState::lost;
    filter_.scatter();
  }
}

// What is followed, and was tracked a moment ago, cannot have come there. One of the two is something else: the find,
// unless it is found again and again.
bool RegionTracker::is_out_of_reach(const ObjectSearch::Find& find, capture::Timestamp set_at) {
  constexpr double sigmas = 3;
  constexpr unsigned sure_finds = 3;
  const MotionState& belief = filter_.belief();
  const double sigma_m = std::hypot(largest_sigma(belief.position_covariance()), largest_sigma(find.now.covariance));
  const double reach_m = sigmas * sigma_m + filter_.kick_m_s() * capture::seconds(set_at - last_tracking_);
  const bool is_near = (find.now.position - belief.position()).norm() <= reach_m;
  finds_out_of_reach_ = state_ != TrackState::coasting || is_near ? 0 : finds_out_of_reach_ + 1;
  return finds_out_of_reach_ > 0 && finds_out_of_reach_ < sure_finds;
}

// The belief as it is while nothing is known of how far the views agree tells when they saw it, and so how far they do.
// Where they do not, it begins once more with that: who was believed in the first sets would hold for long.
void RegionTracker::start_compared(const ObjectSearch::Find& find, capture::Timestamp set_at) {
  const ObjectFilter before = filter_;
  start_at(find, set_at);
  consistency_.compare_found(filter_.belief(), sightings_);
  if (std::ranges::none_of(sightings_, [](const Sighting& s) { return s.inflation_px2 > 0; })) return;
  filter_ = before;
  start_at(find, set_at);
}

// The belief that the sightings of two sets give, from nothing but what is usual.
void RegionTracker::start_at(const ObjectSearch::Find& find, capture::Timestamp set_at) {
  last_reported_ = capture::Timestamp::min();
  is_known_ = false;
  shows_discs_ = has_moved_ = false;
  sightings_ = filter_.start(find.earlier, find.now, consistency_, set_at, find.dt, sets_apart_ == 0, last_reported_);
  found_at_ = filter_.belief().position();
  seen_ = sightings_;
  clutter_mask_.mark_clipped(sightings_);
}

// Furniture is seldom a disc in two views, and its parts are less than a dozen radii apart.
void RegionTracker::note_looks() {
  constexpr double furthest_parts_radii = 12;
  shows_discs_ = shows_discs_ || shows_discs(sightings_);
  has_moved_ = has_moved_ || (state_ == TrackState::tracking && (filter_.belief().position() - found_at_).norm() >
                                                                    furthest_parts_radii * target_.radius_m);
}

// What was found in a room of its colour, and may be a part of the room as well, is followed but not told: of nobody it
// is known where he is. So is what was found by views that contradict one another, none of which is to be believed, and
// what something else that may be the object looks more like than this does.
TrackState RegionTracker::told_state() {
  if (state_ == TrackState::tracking || state_ == TrackState::coasting) note_looks();
  const bool is_another_likelier = has_rival_ && !looks_like_object();
  is_known_ = is_known_ || (state_ == TrackState::tracking && !is_another_likelier);
  const bool may_be_furniture =
      state_ == TrackState::coasting && (clutter_mask_.is_room_shared() || consistency_.no_consistent_pair());
  const bool is_tentative = !is_known_ && (may_be_furniture || is_another_likelier);
  const bool was_told = told_ == TrackState::tracking || told_ == TrackState::coasting;
  if (!is_tentative)
    told_ = state_;
  else if (was_told)
    told_ = TrackState::lost;
  return told_;
}

ObjectEstimate RegionTracker::report(const capture::FrameSet& set) {
  return object_trackers::report({.set = set,
                                  .views = views_,
                                  .radius_m = target_.radius_m,
                                  .options = options_,
                                  .state = told_state(),
                                  .filter = filter_,
                                  .agreement = consistency_,
                                  .sightings = sightings_,
                                  .seen = seen_},
                                 rig_error_, last_reported_);
}

}  // namespace huetrack::object_trackers
