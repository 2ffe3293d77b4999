// Detects objects of the target's colour beyond its count. Diagnostic only: it does not affect the estimate.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/motion_state.h"
#include "object_tracking/objects/object_births.h"
#include "object_tracking/objects/object_existence.h"
#include "object_tracking/objects/object_search.h"
#include "object_tracking/objects/static_clutter_mask.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::objects {

// Hysteresis: published once seen for delay_s, until gone for as long. thread-compatible.
class FurtherObject {
 public:
  explicit FurtherObject(double delay_s) : delay_s_(delay_s) {}

  // The result of each search; times ascend.
  void note(capture::Timestamp set_at, const std::optional<Eigen::Vector3d>& seen_at);
  const std::optional<Eigen::Vector3d>& published() const { return published_; }  // nullopt: none

 private:
  double delay_s_;
  std::optional<Eigen::Vector3d> published_;
  std::optional<capture::Timestamp> since_;  // seen or gone since then, unlike what is published
};

// While one object is tracked in a room that does not share its colour: every ObjectTrackerOptions::coast_s, searches
// whole images in two frame sets for a birth (object_births.h) with confirmed existence. thread-compatible.
class FurtherObjectWatch {
 public:
  FurtherObjectWatch(const object_tracking::TargetOptions& target, const object_tracking::ObjectTrackerOptions& options)
      : target_(target),
        options_(options),
        births_(of_several(target), options, options.volume),
        further_(options.coast_s) {}

  // The target was tracked in this set by these sightings.
  void look(const std::vector<object_tracking::TargetView>& views, std::span<const object_tracking::Sighting> sightings,
            const object_tracking::MotionState& state, ObjectSearch& search, const ClutterMap& clutter,
            const StaticClutterMask& still, capture::Timestamp set_at);
  // It was not tracked, or the room shares the colour.
  void note_untracked(capture::Timestamp set_at);
  const std::optional<Eigen::Vector3d>& published() const { return further_.published(); }

 private:
  static object_tracking::TargetOptions of_several(object_tracking::TargetOptions target) {
    target.count = object_tracking::TargetOptions::most_count;
    return target;
  }
  void find_others(const std::vector<object_tracking::TargetView>& views, const object_tracking::MotionState& state,
                   ObjectSearch& search);

  object_tracking::TargetOptions target_;
  object_tracking::ObjectTrackerOptions options_;
  ObjectBirths births_;
  std::vector<std::vector<color::ColorRegion>> regions_;  // of the views, without the target's
  std::optional<capture::Timestamp> looked_at_;
  bool is_second_ = false;  // the first of the two sets was searched
  std::optional<capture::Timestamp> nothing_since_;
  FurtherObject further_;
};

}  // namespace huetrack::objects
