// `observation: huetrack`, of one object: a Gaussian particle filter (Kotecha and Djuric 2003) over the position, with
// the velocity marginalised. Between sets the state is one Gaussian over (position, velocity). How it differs from the
// paper:
//   - proposal: particles are drawn from the motion model AND the measured colour regions (the optimal proposal of
//   Doucet,
//     Godsill and Andrieu 2000); 200 particles suffice.
//   - measurement: the centre of the colour region, whose covariance depends on the object's radius and on how much of
//   it
//     is hidden (sighting.h). The paper's floor of 1/25 stays: no view can veto.
//   - motion: constant velocity with white acceleration, whose size is learnt from the innovations. A bounce is
//   followed
//     within the set if two views or more see where the object went.
//   - time: a measurement is of the moment when its row was exposed. Each camera's timing is part of the state.
//   - consistency: inconsistent views have their covariance inflated (epipolar_consistency.h) by an error that lasts,
//   like that of
//     a pose, so that no number of frames averages it out. A position that this leaves too uncertain is not `tracking`.
//   - search: rays of matching pixels of a coarse grid are intersected between views; a second set confirms them.
//   - existence: log-odds against clutter decide what is published (object_existence.h). A find that is likelier than a
//     coasting track replaces it.
//   - calibration: the published covariance contains the rig file's own (rig_error.h).
// A position is of the time of the newest measurement in its set; of the set's own time where that is within 2 ms of
// it, or no view sees the object. Alternatives that were tried: object_tracking/EXPERIMENTS.md.
#pragma once

#include <span>
#include <vector>

#include "object_tracking/object_estimate.h"
#include "object_tracking/objects/further_objects.h"
#include "object_tracking/objects/object_existence.h"
#include "object_tracking/objects/object_search.h"
#include "object_tracking/objects/static_clutter_mask.h"
#include "object_tracking/rig_error.h"
#include "object_tracking/seen_regions.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"
#include "object_tracking/trackers/object_filter.h"
#include "object_tracking/trackers/object_sighter.h"
#include "object_tracking/view_consistency.h"
#include "particle_filter/random.h"

namespace huetrack::object_trackers {

// Functions as of ObjectTracker. thread-compatible.
class RegionTracker {
 public:
  RegionTracker(const calib::CameraRig& rig, const object_tracking::TargetOptions& target,
                const object_tracking::ObjectTrackerOptions& options, particle_filter::Rng rng);

  object_tracking::ObjectEstimate update(const capture::FrameSet& set);
  void learn();
  void trust(std::span<const object_tracking::CameraTrust> cameras);
  void correct_times(std::span<const double> late_s);
  void begin_anew();
  object_tracking::TargetViews& views() { return views_; }
  const object_tracking::TargetViews& views() const { return views_; }
  const PositionParticles& particles() const { return filter_.particles(); }
  std::span<const object_tracking::SeenRegion> regions() const { return seen_regions_.all(); }
  const std::vector<object_tracking::ColorShare>& color_shares() const { return clutter_mask_.shares(); }
  const std::optional<Eigen::Vector3d>& further_object() const { return further_.published(); }
  objects::SearchFindings search_findings() const { return search_.findings(); }
  object_tracking::OutlineFindings outline_findings() const { return sighter_.outlines().findings(); }
  void expected_outlines(std::size_t camera, std::vector<capture::ExpectedOutline>& out) const;

 private:
  bool is_followed() const;  // tracking or coasting
  void follow(const capture::FrameSet& set, const std::vector<object_tracking::TargetView>& views);
  double learn_acceleration(const capture::FrameSet& set, const std::vector<object_tracking::TargetView>& views);
  void judge(const capture::FrameSet& set);
  void forget();
  void search(const capture::FrameSet& set, const std::vector<object_tracking::TargetView>& views);
  void start_compared(const objects::ObjectSearch::Find& find, capture::Timestamp set_at);
  void start_at(const objects::ObjectSearch::Find& find, capture::Timestamp set_at);
  object_tracking::TrackState published_state();
  object_tracking::ObjectEstimate report(const capture::FrameSet& set);

  object_tracking::TargetOptions target_;
  object_tracking::ObjectTrackerOptions options_;
  object_tracking::TargetViews views_;
  ObjectSighter sighter_;
  object_tracking::ViewConsistency consistency_;
  ObjectFilter filter_;
  objects::ObjectSearch search_;
  object_tracking::RigError rig_error_;
  objects::StaticClutterMask clutter_mask_;
  objects::ClutterMap clutter_;
  objects::ObjectExistence existence_;
  objects::FurtherObjectWatch further_;

  std::vector<object_tracking::Sighting> sightings_;  // of this set, sorted by the time of their rows
  std::vector<object_tracking::Sighting> seen_;       // also inconsistent ones, and those of cameras that are not used
  std::vector<object_tracking::Sighting> watched_;    // of cameras that are not used
  object_tracking::SeenRegions seen_regions_;         // of this set

  object_tracking::TrackState state_ = object_tracking::TrackState::searching;
  object_tracking::TrackState published_ = object_tracking::TrackState::searching;  // in the last set
  bool was_tracked_ = false;                                                        // since it was initialised
  capture::Timestamp last_at_{}, last_tracking_{};                                  // of the sets
  bool is_kept_ = false;  // followed into this set, not found in it: a first position is too unsure to learn around it
  std::size_t sets_apart_ = 0;  // whose frames were not taken at one moment
  capture::Timestamp last_published_ = capture::Timestamp::min();
};

}  // namespace huetrack::object_trackers
