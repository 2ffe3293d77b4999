// Detects setup mistakes from the tracks (view_watch) and inflates the pose covariance of the cameras that they affect,
// for the trackers of all targets. Facts for the outputs; no sentences.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "object_tracking/trackers/object_tracker.h"
#include "view_watch/path_times.h"
#include "view_watch/view_watch.h"

namespace huetrack::pipeline {

// thread-compatible: the tracking thread's. Deterministic: depends on the sets only.
class MistakeWatch {
 public:
  // targets: in the order of the trackers.
  MistakeWatch(const calib::CameraRig& rig, std::span<const object_tracking::TargetOptions> targets);

  // A target has another colour or radius: forgets its history.
  void reset_target(std::size_t target, const object_tracking::TargetOptions& options);

  // The next set does not continue the last one. What was found stays.
  void begin_anew();

  // After the trackers' update with that set. moved: per camera of the rig, known to have been moved (room_watch), so
  // its inconsistencies are explained. Returns whether inflation() changed.
  bool look(const capture::FrameSet& set, std::span<const object_tracking::ObjectEstimate> estimates,
            std::span<const object_trackers::ObjectTracker> trackers, const std::vector<bool>& moved);

  // By the last look(), for all trackers: the timing is the rig's. ViewWatch::late_s() of the first target that shows
  // it.
  const std::vector<double>& late_s() const { return late_s_; }

  // In force now, per target.
  std::span<const std::vector<view_watch::Mistake>> mistakes() const { return mistakes_; }

  // Per camera of the rig: additional rotation sigma on each axis, rad; 0: the rig's own uncertainty suffices.
  const std::vector<double>& inflation() const { return inflation_; }

 private:
  struct PathOfCamera {
    view_watch::PathTimes times;
    std::optional<view_watch::Mistake> fault;
  };
  std::vector<PathOfCamera> paths_of(const object_tracking::TargetOptions& target) const;
  void look_at_paths(const capture::FrameSet& set, std::span<const object_tracking::SeenRegion> regions,
                     std::vector<PathOfCamera>& paths);
  void inflate(const view_watch::Mistake& mistake);

  calib::CameraRig rig_;
  std::vector<view_watch::ViewWatch> watches_;
  std::vector<std::vector<PathOfCamera>> paths_;  // per target and camera
  std::optional<capture::Timestamp> first_at_;
  std::vector<std::vector<view_watch::Mistake>> mistakes_;
  std::vector<double> late_s_;
  std::vector<double> inflation_, previous_inflation_;
};

// Size of a mistake as an equivalent rotation error of a camera, rad, in any direction; 0: it implies none.
double inflation_rad(const view_watch::Mistake& mistake, const calib::Camera& camera);

// Adds the inflation to the rotation covariances. trust: per camera of the rig.
void add_inflation(std::span<const double> doubts, std::vector<object_tracking::CameraTrust>& trust);

}  // namespace huetrack::pipeline
