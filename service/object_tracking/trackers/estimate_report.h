// What is told of one object after a set, from what is believed of it.
#pragma once

#include <span>

#include "capture/frame.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/rig_error.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/trackers/object_filter.h"
#include "object_tracking/view_consistency.h"

namespace huetrack::object_trackers {

struct ToReport {
  const capture::FrameSet& set;
  const object_tracking::TargetViews& views;
  double radius_m;
  const object_tracking::ObjectTrackerOptions& options;
  object_tracking::TrackState state;
  const ObjectFilter& filter;
  const object_tracking::ViewConsistency& agreement;
  std::span<const object_tracking::Sighting> sightings;  // of this set, by the times of their rows
  std::span<const object_tracking::Sighting>
      seen;  // also those that contradict, and those of cameras that are not used
};

// Of a set after which nothing is told but which cameras delivered, and their times.
object_tracking::ObjectEstimate without_position(const capture::FrameSet& set,
                                                 const object_tracking::TargetViews& views,
                                                 const object_tracking::MotionState& belief,
                                                 object_tracking::TrackState state);

// last_reported: of the object, updated. Positions are told in the order of time.
object_tracking::ObjectEstimate report(const ToReport& what, object_tracking::RigError& rig_error,
                                       capture::Timestamp& last_reported);

}  // namespace huetrack::object_trackers
