// The published estimate of one object after a set.
#pragma once

#include <span>

#include "capture/frames/frame.h"
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
  std::span<const object_tracking::Sighting> sightings;  // of this set, sorted by the time of their rows
  std::span<const object_tracking::Sighting> seen;       // with inconsistent views and cameras that are not used
  double hidden_radii;                                   // hidden_error() of the last sightings
};

// In radii, 1 sigma per axis, by what hides a part of the object in its views: a hand hides the same side in all of
// them, so that their errors do not cancel, and the filter follows them.
double hidden_error(std::span<const object_tracking::Sighting> sightings);

// An estimate without a position: which cameras delivered, their timing and inconsistency.
object_tracking::ObjectEstimate without_position(const capture::FrameSet& set,
                                                 const object_tracking::TargetViews& views, const ObjectFilter& filter,
                                                 const object_tracking::ViewConsistency& agreement,
                                                 object_tracking::TrackState state);

// last_published: of this object; updated. Output stamps strictly increase.
object_tracking::ObjectEstimate report(const ToReport& in, object_tracking::RigError& rig_error,
                                       capture::Timestamp& last_published);

}  // namespace huetrack::object_trackers
