#include "object_tracking/trackers/region_tracker.h"

#include <algorithm>
#include <cmath>

#include "object_tracking/trackers/estimate_report.h"

namespace huetrack::object_trackers {

using namespace object_tracking;
using namespace objects;

RegionTracker::RegionTracker(const calib::CameraRig& rig, const TargetOptions& target,
                             const ObjectTrackerOptions& options, particle_filter::Rng rng)
    : target_(target),
      options_(options),
      views_(rig, target),
      sighter_(rig, target, options),
      consistency_(rig.cameras.size(), target.radius_m, options),
      filter_(rig, target, options, rng),
      search_(rig, target, options),
      rig_error_(rig, options.max_coast_sigma_m),
      clutter_mask_(rig.cameras.size(), 1),
      clutter_(rig),
      further_(target, options, search_.sizes_in_view()),
      seen_regions_(options.pixel_noise_px) {
  for (std::size_t c = 0; c < rig.cameras.size(); ++c)
    clutter_mask_.set_sizes(c, search_.size_in_view(c).smallest_px, search_.size_in_view(c).largest_px,
                            rig.cameras[c].image_size);
}

bool RegionTracker::is_followed() const {
  return state_ == TrackState::tracking || state_ == TrackState::coasting;
}

ObjectEstimate RegionTracker::update(const capture::FrameSet& set) {
  const std::vector<TargetView>& views = views_.look_at(set);
  clutter_mask_.look(views, set.at);
  for (std::size_t c = 0; c < views_.camera_count(); ++c) consistency_.set_shared(c, clutter_mask_.is_shared(c));
  search_.set_shared(clutter_mask_.is_room_shared());
  sightings_.clear();
  seen_.clear();
  watched_.clear();
  seen_regions_.clear();
  sets_apart_ += is_apart(views) ? 1 : 0;
  if (set.at < last_at_) forget();  // the clock was set back: the state is of another time
  filter_.motion().open_clocks(set);
  const bool was_followed = is_followed();
  if (was_followed) follow(set, views);
  is_kept_ = was_followed && is_followed();
  if (state_ != TrackState::tracking) search(set, views);
  last_at_ = set.at;
  return report(set);
}

void RegionTracker::learn() {
  const std::vector<TargetView>& views = views_.used();
  if (is_kept_) {
    sighter_.learn_behind(views, filter_.motion());
    sighter_.learn_behind(views_.unused(), filter_.motion());
  }
  std::vector<Sighting> tracked = sightings_;
  if (clutter_mask_.is_room_shared() && is_followed()) add_expected(views, filter_.motion(), target_.radius_m, tracked);
  clutter_mask_.learn(views, tracked, last_at_);
  if (state_ == TrackState::tracking && !clutter_mask_.is_room_shared())
    further_.look(views, sightings_, filter_.motion(), clutter_, clutter_mask_, last_at_);
  else
    further_.note_untracked(last_at_);
}

void RegionTracker::follow(const capture::FrameSet& set, const std::vector<TargetView>& views) {
  sighter_.sight(views, filter_, consistency_, sightings_);
  sighter_.sight(views_.unused(), filter_, consistency_, watched_);
  clutter_mask_.mark_clipped(sightings_);
  consistency_.compare(views, set.at, filter_.motion(), sightings_, watched_, seen_regions_);
  seen_ = sightings_;
  seen_.insert(seen_.end(), watched_.begin(), watched_.end());
  const double acceleration_before = filter_.acceleration();
  double power_density = learn_acceleration(set, views);
  existence_.update(set.at, filter_.motion(), power_density, sightings_, views, target_.radius_m, clutter_,
                    clutter_mask_);
  if (existence_.is_chance()) {  // clutter would lead the track away
    sightings_.clear();
    filter_.set_acceleration(acceleration_before);
    power_density = filter_.power_density();
  }
  filter_.update(sightings_, set.at, last_published_, power_density);
  judge(set);
}

void RegionTracker::expected_outlines(std::size_t camera, std::vector<capture::ExpectedOutline>& out) const {
  if (!sighter_.outlines().is_enabled() || !is_followed()) return;
  const auto view = std::ranges::find(views_.used(), static_cast<int>(camera), &TargetView::index);
  if (view == views_.used().end()) return;
  const auto expected = expected_in(*view, filter_.motion(), target_.radius_m);
  if (!expected) return;
  const Eigen::Vector2f px = expected->at.px.cast<float>();
  const Eigen::Vector2f velocity = (expected->at.jacobian * filter_.motion().velocity()).cast<float>();
  out.push_back({.u = px.x(),
                 .v = px.y(),
                 .u_per_s = velocity.x(),
                 .v_per_s = velocity.y(),
                 .radius_px = static_cast<float>(expected->at.radius_px)});
}

void RegionTracker::trust(std::span<const CameraTrust> cameras) {
  const std::vector<std::size_t> changed = views_.trust(cameras);
  for (const std::size_t c : changed)
    filter_.forget_camera(static_cast<int>(c)), clutter_mask_.forget(c), clutter_.forget(c);
  if (!changed.empty()) search_.forget();
  consistency_.trust(changed, cameras);
  rig_error_.exclude_poses(cameras);
}

void RegionTracker::correct_times(std::span<const double> late_s) {
  filter_.correct_times(late_s);
  consistency_.forget();
}

void RegionTracker::begin_anew() {
  forget();
  state_ = published_ = TrackState::searching;
  was_tracked_ = is_kept_ = false;
}

// Returns the power density for this set. That of a bounce is not learnt: the motion after it is as calm as before.
double RegionTracker::learn_acceleration(const capture::FrameSet& set, const std::vector<TargetView>& views) {
  const double before = filter_.acceleration();
  filter_.raise_acceleration(sightings_);
  const MotionState& motion = filter_.motion();
  const double dt = capture::seconds(set.at - motion.at);
  const bool is_unexplained = filter_.is_unexplained(sightings_);
  if (dt > 0 && views.size() >= 2 && (sightings_.size() < 2 || is_unexplained)) {
    const double kick = filter_.kick_m_s();
    const double q = kick * kick / dt;
    const bool is_seen = sighter_.sight_after_bounce(views, target_, motion, q, sightings_.size(), sightings_);
    if (is_seen) {
      // Only these measurements fix the position now.
      const PositionInformation seen = information_of(sightings_, motion.position());
      const Eigen::Matrix3d covariance = seen.information.inverse();
      const Eigen::Vector3d position = covariance * seen.vector;
      if (position.allFinite()) {
        MotionState about = motion;
        about.begin(set.at, position, largest_variance(covariance), (position - motion.position()) / dt, kick * kick);
        sighter_.sharpen(views, about, sightings_);
        sort_by_time(sightings_);
      }
      consistency_.inflate(motion, sightings_);
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

void RegionTracker::judge(const capture::FrameSet& set) {
  const MotionState& motion = filter_.motion();
  const Judged now = judged(options_, filter_, sightings_, consistency_.inflated_sigma(motion, sightings_),
                            capture::seconds(set.at - last_tracking_),
                            // An object outside of the volume may come back, and is not published as tracking.
                            inside(options_.volume, motion.position(), target_.radius_m));
  if (now.state == TrackState::lost || existence_.is_refuted()) return forget();
  state_ = existence_.is_sure() ? now.state : TrackState::coasting;
  if (now.is_seen) last_tracking_ = set.at;
}

void RegionTracker::search(const capture::FrameSet& set, const std::vector<TargetView>& views) {
  // A set of cameras of different rates neither confirms nor refutes.
  if (views.size() < std::min<std::size_t>(2, views_.camera_count())) return;
  search_.look(views);
  for (std::size_t i = 0; i < views.size(); ++i)
    if (!seen_regions_.has(views[i].index)) seen_regions_.add_others(views[i], search_.regions()[i]);
  if (sightings_.empty()) {
    consistency_.compare_moving(views, search_.regions(), search_.usual_radii_px(views), set.at, filter_.motion());
  }
  // Until the timing is estimated, cameras with equal stamps count as synchronised in a room that shares the colour:
  // with open timing nearly any two rays of its regions would meet.
  MotionState times = filter_.motion();
  if (clutter_mask_.is_room_shared() && sets_apart_ == 0 && last_tracking_ == capture::Timestamp{})
    times.expect_synchronised();
  auto find = search_.find(views, set.at, times, clutter_, clutter_mask_);
  if (find) clutter_.claim(find->earlier.sightings);
  clutter_.add(views, search_.regions());
  clutter_.claim(sightings_);
  if (!find) return;
  // The detection is the track that is not confirmed yet.
  if (state_ == TrackState::coasting && sightings_.size() >= std::min<std::size_t>(2, views.size()) &&
      (find->now.position - filter_.motion().position()).norm() < sighting_tuning.same_object_radii * target_.radius_m)
    return;
  ObjectExistence found;
  found.begin(set.at, *find, views, target_.radius_m, options_, times, clutter_, clutter_mask_);
  // Two hypotheses: the likelier one is tracked; of equal ones a track that is seen.
  const double by_find = found.log_odds(), by_track = existence_.log_odds();
  if (state_ == TrackState::coasting && (by_find < by_track || (by_find == by_track && !sightings_.empty()))) return;
  MotionState about = filter_.motion();
  const double variance_m2 = std::pow(largest_sigma(find->now.covariance), 2);
  about.begin(set.at, find->now.position, variance_m2, (find->now.position - find->earlier.position) / find->dt,
              2 * variance_m2 / (find->dt * find->dt));
  sighter_.sharpen(views, about, find->now.sightings);
  existence_ = found;
  start_compared(*find, set.at);
  const MotionState& motion = filter_.motion();
  const TrackState begun =
      judged_at_start(options_, filter_, sightings_, consistency_.inflated_sigma(motion, sightings_),
                      existence_.is_sure() && inside(options_.volume, motion.position(), target_.radius_m));
  if (begun != TrackState::lost) {
    state_ = begun;
    last_tracking_ = set.at;
    search_.found();
    clutter_.claim(sightings_);
    return;
  }
  sightings_.clear();  // views this inconsistent have detected nothing
  seen_.clear();
  if (state_ == TrackState::coasting) {
    state_ = TrackState::lost;
    filter_.scatter();
  }
}

// The first initialisation gives the rows' times, and with them how consistent the views are. If they are not, it is
// repeated with inflated covariances: what the first sets claim would last for long.
void RegionTracker::start_compared(const ObjectSearch::Find& find, capture::Timestamp set_at) {
  const ObjectFilter before = filter_;
  start_at(find, set_at);
  consistency_.compare_found(filter_.motion(), sightings_);
  if (std::ranges::none_of(sightings_, [](const Sighting& s) { return s.inflation_px2 > 0; })) return;
  filter_ = before;
  start_at(find, set_at);
}

void RegionTracker::start_at(const ObjectSearch::Find& find, capture::Timestamp set_at) {
  last_published_ = capture::Timestamp::min();
  was_tracked_ = is_kept_ = false;
  sightings_ = filter_.start(find.earlier, find.now, consistency_, set_at, find.dt, sets_apart_ == 0, last_published_);
  seen_ = sightings_;
  clutter_mask_.mark_clipped(sightings_);
}

// A track whose existence is not confirmed yet, or of whose views no two are consistent, stays unpublished until it has
// been tracking once.
TrackState RegionTracker::published_state() {
  was_tracked_ = was_tracked_ || state_ == TrackState::tracking;
  const bool is_tentative =
      !was_tracked_ && state_ == TrackState::coasting && (!existence_.is_sure() || consistency_.no_consistent_pair());
  const bool was_published = published_ == TrackState::tracking || published_ == TrackState::coasting;
  if (!is_tentative)
    published_ = state_;
  else if (was_published)
    published_ = TrackState::lost;
  return published_;
}

ObjectEstimate RegionTracker::report(const capture::FrameSet& set) {
  return object_trackers::report({.set = set,
                                  .views = views_,
                                  .radius_m = target_.radius_m,
                                  .options = options_,
                                  .state = published_state(),
                                  .filter = filter_,
                                  .agreement = consistency_,
                                  .sightings = sightings_,
                                  .seen = seen_},
                                 rig_error_, last_published_);
}

}  // namespace huetrack::object_trackers
