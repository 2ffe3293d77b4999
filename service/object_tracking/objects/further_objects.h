// Whether there is more of the target's colour than its count says: one object more, or something else that looks like
// one. It moves nothing; a user wants to know, as what is tracked may at any time be the other one.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/motion_state.h"
#include "object_tracking/objects/object_births.h"
#include "object_tracking/objects/object_search.h"
#include "object_tracking/objects/static_clutter_mask.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::objects {

// What was seen for a while and stays in force until it was gone for as long. thread-compatible.
class FurtherObject {
 public:
  // Whether it was seen, and where, each time it was looked for. Times ascend.
  void note(capture::Timestamp set_at, const std::optional<Eigen::Vector3d>& seen_at);
  const std::optional<Eigen::Vector3d>& told() const { return told_; }  // nullopt: there is none

 private:
  std::optional<Eigen::Vector3d> told_;
  std::optional<capture::Timestamp> since_;  // it is seen, or gone, against what is told
};

// Beside one object that is tracked, in a room that does not share its colour. Once a second the views are looked
// through as a whole in two sets, for what would be a birth among several objects (object_births.h). thread-compatible.
class FurtherObjectWatch {
 public:
  // sizes: of the target, per camera of the rig
  FurtherObjectWatch(const object_tracking::TargetOptions& target, const object_tracking::ObjectTrackerOptions& options,
                     std::span<const SizeInView> sizes);

  // The target was tracked in this set, by these sightings.
  void look(const std::vector<object_tracking::TargetView>& views, std::span<const object_tracking::Sighting> sightings,
            const object_tracking::MotionState& belief, const StaticClutterMask& still, capture::Timestamp set_at);
  // It was not, or the room shares the colour: nothing is known of others.
  void note_untracked(capture::Timestamp set_at);
  const std::optional<Eigen::Vector3d>& told() const { return further_.published(); }

 private:
  void find_others(const std::vector<object_tracking::TargetView>& views, const object_tracking::MotionState& belief);

  object_tracking::TargetOptions target_;
  ObjectBirths births_;
  std::vector<SizeInView> size_in_view_;                  // per camera
  std::vector<color::RegionFinder> finders_;              // per camera
  std::vector<std::vector<color::ColorRegion>> regions_;  // of the views of this set, without the target's
  std::optional<capture::Timestamp> looked_at_;
  bool is_second_ = false;                           // the first of two sets was looked through
  std::optional<capture::Timestamp> nothing_since_;  // nothing is known of others
  FurtherObject further_;
};

}  // namespace huetrack::objects
