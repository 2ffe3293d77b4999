// Our own observation and filter, `observation: huetrack`: a Gaussian particle filter (Kotecha and Djuric 2003) over
// the position, with the velocity marginalised. Between frame sets the belief is one Gaussian over (position,
// velocity); in a set, positions are drawn from it, weighed by what every view shows at their projections, and give the
// next one. What differs from the paper, and why:
//   - proposal: particles are drawn from motion AND the colour regions near the prediction (the optimal proposal of
//     Doucet, Godsill and Andrieu 2000), not from the motion alone. 200 particles then sit where they matter.
//   - observation: the centre of the colour region is rewarded, not the inside of it, with a covariance that knows the
//     object's radius and sees when a part of it is hidden (sighting.h). The paper's floor of 1/25 stays: no view can
//     veto.
//   - motion: constant velocity with white acceleration; how much of it is needed is learnt from the innovations, so
//     that calm motion is smoothed and a thrown ball followed. A bounce, which none of it explains, is followed within
//     the set, when two views or more see where the object went.
//   - time: a sighting counts when the row was exposed in which it lies. When that is, per camera, is part of what is
//     believed and learnt (motion_state.h).
//   - trust: views that contradict one another are doubted by as much as they do (epipolar_consistency.h). What is doubted is an
//     error that lasts, like a pose that is not quite known, so that no number of frames averages it away; it is in the
//     covariance, and what it leaves too open is not `tracking`.
//   - search: rays crossed between views through matching pixels of a coarse grid, confirmed by a second frame set.
//     Several hypotheses are needed only here, and here they are kept.
//   - calibration: what the rig's own covariance leaves open of a position, where it has one, is in the covariance that
//     is told (rig_error.h).
// A position is that of the moment of the newest sighting in its set; of the set's own time, where that is within 2 ms
// of it or nobody sees the object.
// What else was tried, with figures: README.md beside this file.
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

// The road of one set, for a target that is one object. thread-compatible.
class RegionTracker {
 public:
  RegionTracker(const calib::CameraRig& rig, const object_tracking::TargetOptions& target,
                const object_tracking::ObjectTrackerOptions& options, particle_filter::Rng rng);

  object_tracking::ObjectEstimate update(const capture::FrameSet& set);
  void trust(std::span<const object_tracking::CameraTrust> cameras);
  // The colour is not the object's (SearchFindings::is_found_at_twice_the_hue): what was found is something else, and
  // from now on only what moves is.
  void distrust_color(capture::Timestamp set_at);
  bool has_moved() const { return has_moved_; }  // since it was found, while it was tracked
  // Since it was found it moved, or showed whole discs of its size in two views of one set, which what is no ball
  // rarely does.
  bool looks_like_object() const { return shows_discs_ || has_moved_; }
  // Something else looks like the object: before this one does, it is not told.
  void set_rival(bool has_rival) { has_rival_ = has_rival; }
  void correct_times(std::span<const double> late_s);
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
  bool is_out_of_reach(const objects::ObjectSearch::Find& find, capture::Timestamp set_at);
  double learn_acceleration(const capture::FrameSet& set, const std::vector<object_tracking::TargetView>& views);
  void weigh_existence(capture::Timestamp set_at, double power_density,
                       const std::vector<object_tracking::TargetView>& views);
  void judge(const capture::FrameSet& set);
  void forget();
  void search(const capture::FrameSet& set, const std::vector<object_tracking::TargetView>& views);
  void start_compared(const objects::ObjectSearch::Find& find, capture::Timestamp set_at);
  void start_at(const objects::ObjectSearch::Find& find, capture::Timestamp set_at);
  void note_looks();
  object_tracking::TrackState told_state();
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
  objects::ClutterMap clutter_;         // while the room shares the colour
  objects::ObjectExistence existence_;  // while the room shares the colour
  objects::FurtherObjectWatch further_;

  std::vector<object_tracking::Sighting> sightings_;  // of this set, by the times of their rows
  // All that views show of the object in this set: also what contradicts, and what cameras see that are not used.
  std::vector<object_tracking::Sighting> seen_;
  std::vector<object_tracking::Sighting> watched_;  // by cameras that are not used
  object_tracking::SeenRegions seen_regions_;       // of this set

  object_tracking::TrackState state_ = object_tracking::TrackState::searching;
  bool is_known_ = false;  // it was told as tracked since it was found
  bool has_rival_ = false;
  bool shows_discs_ = false, has_moved_ = false;
  Eigen::Vector3d found_at_ = Eigen::Vector3d::Zero();
  object_tracking::TrackState told_ = object_tracking::TrackState::searching;  // in the last set
  capture::Timestamp last_at_{}, last_tracking_{};                             // of the sets
  unsigned finds_out_of_reach_ = 0;                                            // in the last sets, one after the other
  std::size_t sets_apart_ = 0;  // whose frames were not taken at one moment
  capture::Timestamp last_reported_ = capture::Timestamp::min();
};

}  // namespace huetrack::object_trackers
