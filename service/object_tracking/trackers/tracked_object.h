// One object that is tracked: what the steps of a frame set (region_tracker.h) know of it.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "object_tracking/object_estimate.h"
#include "object_tracking/objects/object_existence.h"
#include "object_tracking/rig_error.h"
#include "object_tracking/sighting.h"
#include "object_tracking/tracker_options.h"
#include "object_tracking/trackers/object_filter.h"
#include "particle_filter/random.h"

namespace huetrack::object_trackers {

struct TrackedObject {
  TrackedObject(const calib::CameraRig& rig, const object_tracking::TargetOptions& target,
                const object_tracking::ObjectTrackerOptions& options, particle_filter::Rng rng,
                object_tracking::RigError of_rig)
      : filter(rig, target, options, rng), rig_error(std::move(of_rig)) {}

  std::uint32_t number = 0;  // 0: not published yet
  ObjectFilter filter;
  object_tracking::RigError rig_error;
  objects::ObjectExistence existence;
  object_tracking::TrackState state = object_tracking::TrackState::tracking;  // lost: its track has ended
  bool is_published = false;                                                  // in the last set
  bool is_out_of_picture = false;  // of the only camera: followed, but not published
  bool is_new = true;              // found in this set: its position is too unsure to learn around it
  capture::Timestamp last_tracking{}, last_inside{}, last_published = capture::Timestamp::min();
  double hidden_radii = 0;  // hidden_error() of the last sightings
  // Of this set, sorted by the time of their rows.
  std::vector<object_tracking::Sighting> sightings;
  std::vector<object_tracking::Sighting> watched;  // of cameras that are not used
  std::vector<object_tracking::Sighting> seen;     // all of these, as measured
};

using TrackedObjects = std::vector<std::unique_ptr<TrackedObject>>;  // by age
using SightingsOf = std::vector<object_tracking::Sighting> TrackedObject::*;

}  // namespace huetrack::object_trackers
