// `observation: huetrack`, of one object or several of one colour. Each object has a Gaussian particle filter (Kotecha
// and Djuric 2003) over the position, with the velocity marginalised. Between sets its state is one Gaussian over
// (position, velocity). How it differs from the paper:
//   - proposal: particles are drawn from the motion model AND the measured colour regions (the optimal proposal of
//     Doucet, Godsill and Andrieu 2000); 200 particles suffice.
//   - measurement: the centre of the colour region, whose covariance depends on the object's radius and on how much of
//     it is hidden (sighting.h). The paper's floor of 1/25 stays: no view can veto.
//   - motion: constant velocity with white acceleration, whose size is learnt from the innovations. A bounce of one
//     object is followed within the set if two views or more see where it went.
//   - time: a measurement is of the moment when its row was exposed. Each camera's timing is part of the state.
//   - consistency: inconsistent views have their covariance inflated (epipolar_consistency.h) by an error that lasts,
//     like that of a pose, so that no number of frames averages it out. A position that this leaves too uncertain is
//     not `tracking`.
//   - birth: rays of regions that no object explains are intersected between views; a second set confirms them
//     (object_births.h).
//   - existence: log-odds against clutter decide what is published (object_existence.h).
//   - calibration: the published covariance contains the rig file's own (rig_error.h).
// One object is measured around its prediction (object_sighter.h), several by assigning the regions of whole images
// (shared_regions.h); all other steps are the same. Objects are solid: two tracks that come to lie within one another
// are one object. Several objects that leave the volume are followed as long as they are seen, so that their regions
// are not taken for something else, but they are not published.
// A position is of the time of the newest measurement in its set; of the set's own time where that is within 2 ms of
// it, or no view sees the object. Alternatives that were tried: object_tracking/EXPERIMENTS.md.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "object_tracking/object_estimate.h"
#include "object_tracking/objects/further_objects.h"
#include "object_tracking/objects/object_births.h"
#include "object_tracking/objects/object_search.h"
#include "object_tracking/objects/search_findings.h"
#include "object_tracking/objects/static_clutter_mask.h"
#include "object_tracking/rig_error.h"
#include "object_tracking/seen_regions.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"
#include "object_tracking/trackers/object_filter.h"
#include "object_tracking/trackers/object_sighter.h"
#include "object_tracking/trackers/published_objects.h"
#include "object_tracking/trackers/shared_regions.h"
#include "object_tracking/trackers/shared_times.h"
#include "object_tracking/trackers/tracked_object.h"
#include "object_tracking/view_consistency.h"

namespace huetrack::object_trackers {

// Functions as of ObjectTracker. thread-compatible.
class RegionTracker {
 public:
  // stream: of random numbers; each object has its own
  RegionTracker(const calib::CameraRig& rig, const object_tracking::TargetOptions& target,
                const object_tracking::ObjectTrackerOptions& options, std::uint64_t stream);

  void update(const capture::FrameSet& set, std::vector<object_tracking::ObjectEstimate>& out);
  void learn();
  void trust(std::span<const object_tracking::CameraTrust> cameras);
  void correct_times(std::span<const double> late_s);
  void begin_anew();
  void take_over_from(const RegionTracker& before);
  void add_times_holders(std::vector<TimesHolder>& out);  // of share_times()
  object_tracking::TargetViews& views() { return views_; }
  const object_tracking::TargetViews& views() const { return views_; }
  PositionParticles particles() const;  // of all objects; of none: uniform in the volume
  std::span<const object_tracking::SeenRegion> regions() const { return seen_regions_.all(); }
  const std::vector<object_tracking::ColorShare>& color_shares() const { return clutter_mask_.shares(); }
  const std::optional<Eigen::Vector3d>& further_object() const {
    return is_alone() ? further_watch_.published() : published_.further_object();
  }
  objects::SearchFindings search_findings() const { return search_log_.findings(); }
  objects::SearchFindings search_findings_of_run() const { return search_log_.findings_of_run(); }
  object_tracking::OutlineFindings outline_findings() const { return sighter_.outlines().findings(); }
  void expected_outlines(std::size_t camera, std::vector<capture::ExpectedOutline>& out) const;

 private:
  bool is_alone() const { return target_.count == 1; }
  void begin_set(const capture::FrameSet& set, const std::vector<object_tracking::TargetView>& views);
  void measure(const std::vector<object_tracking::TargetView>& views, SightingsOf sightings);
  void compare_views(const std::vector<object_tracking::TargetView>& views, capture::Timestamp set_at);
  const TrackedObject* lead() const;
  void follow(TrackedObject& object, const capture::FrameSet& set,
              const std::vector<object_tracking::TargetView>& views);
  double learn_acceleration(TrackedObject& object, const capture::FrameSet& set,
                            const std::vector<object_tracking::TargetView>& views);
  bool measure_after_bounce(TrackedObject& object, const capture::FrameSet& set,
                            const std::vector<object_tracking::TargetView>& views, double power_density);
  bool has_left_picture(const TrackedObject& object) const;
  void judge(TrackedObject& object, const capture::FrameSet& set);
  void end_duplicates();

  void search(const capture::FrameSet& set, const std::vector<object_tracking::TargetView>& views);
  std::vector<objects::Birth> births(const capture::FrameSet& set,
                                     const std::vector<object_tracking::TargetView>& views);
  void begin_track(const objects::Birth& birth, const std::vector<object_tracking::TargetView>& views,
                   capture::Timestamp set_at);
  TrackedObject* coasting_to(const objects::Birth& birth, capture::Timestamp set_at) const;
  bool makes_room(const objects::Birth& birth, const std::vector<object_tracking::TargetView>& views,
                  capture::Timestamp set_at);
  void start(TrackedObject& object, objects::Birth birth, const std::vector<object_tracking::TargetView>& views,
             capture::Timestamp set_at);

  object_tracking::MotionState times() const;

  const calib::CameraRig rig_;
  object_tracking::TargetOptions target_;
  object_tracking::ObjectTrackerOptions options_;
  std::uint64_t stream_;
  object_tracking::TargetViews views_;
  ObjectSighter sighter_;  // of one object
  objects::ObjectSearch search_;
  SharedRegions shared_;  // of several
  object_tracking::ViewConsistency consistency_;
  objects::ObjectBirths births_;
  object_tracking::RigError rig_error_;  // of an object that is found now
  objects::StaticClutterMask clutter_mask_;
  objects::ClutterMap clutter_;
  objects::SearchLog search_log_;
  objects::FurtherObjectWatch further_watch_;  // of one object
  PublishedObjects published_;
  ObjectFilter times_;  // the timing's estimate while there is no object

  TrackedObjects objects_;
  const TrackedObject* lead_ = nullptr;  // of several, the one by which views are compared; an address only
  object_tracking::SeenRegions seen_regions_;
  std::uint64_t started_ = 0;
  std::size_t sets_apart_ = 0;  // whose frames were not taken at one moment
  capture::Timestamp last_at_{};
};

}  // namespace huetrack::object_trackers
