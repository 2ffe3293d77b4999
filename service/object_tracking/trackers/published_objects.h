// Which of the tracked objects are published, and under which numbers.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "capture/frames/frame.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/objects/further_objects.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"
#include "object_tracking/trackers/tracked_object.h"
#include "object_tracking/view_consistency.h"

namespace huetrack::object_trackers {

// An object is published from when its existence is confirmed inside of the volume, and it is tracked or two of its
// views are consistent, up to the target's count, until its track ends or it has left the volume. thread-compatible.
class PublishedObjects {
 public:
  PublishedObjects(const object_tracking::TargetOptions& target, const object_tracking::ObjectTrackerOptions& options)
      : target_(target), options_(options), further_(options.coast_s) {}

  // The estimates of one set, in the order that ObjectTracker::update() states. times: a filter without an object,
  // which keeps the cameras' timing.
  void report(const capture::FrameSet& set, const object_tracking::TargetViews& views,
              const object_tracking::ViewConsistency& agreement, const ObjectFilter& times, TrackedObjects& objects,
              std::vector<object_tracking::ObjectEstimate>& out);

  void end_all(const TrackedObjects& objects);  // the next set does not continue the last one
  // Continues the numbering of `before`, whose objects end with the next report().
  void take_over_from(const PublishedObjects& before, const TrackedObjects& objects);
  // Tracked beyond the target's count.
  const std::optional<Eigen::Vector3d>& further_object() const { return further_.published(); }

 private:
  // Of an object inside of the volume that is not published yet.
  bool is_to_publish(TrackedObject& object, const object_tracking::ViewConsistency& agreement,
                     std::ptrdiff_t& published, std::optional<Eigen::Vector3d>& further_at);
  void note_ended(const TrackedObjects& objects);

  object_tracking::TargetOptions target_;
  object_tracking::ObjectTrackerOptions options_;
  std::uint32_t last_number_ = 0;
  std::uint32_t number_before_ = 0;   // last_number_ when this one took over, or all ended
  std::vector<std::uint32_t> ended_;  // numbers from before that; their end is not published yet
  objects::FurtherObject further_;
};

}  // namespace huetrack::object_trackers
