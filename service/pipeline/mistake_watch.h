// Looks on the road for mistakes that tracks show (view_watch), and says what the trackers are to hold of the cameras
// because of them: a rig that is known to be wrong tells no position with the sigma of a good one. What one target
// shows of a camera holds for all targets. Facts for the outputs; no sentences.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "object_tracking/trackers/object_tracker.h"
#include "view_watch/view_watch.h"

namespace huetrack::pipeline {

// thread-compatible: the tracking thread's. Deterministic: by the sets alone.
class MistakeWatch {
 public:
  // Per target of the road.
  MistakeWatch(const calib::CameraRig& rig, std::span<const object_tracking::TargetOptions> targets);

  // A target has another colour or radius: what was seen of it is forgotten.
  void begin_anew(std::size_t target, const object_tracking::TargetOptions& options);

  // After the trackers' update with that set. moved: per camera of the rig, that it is known to have been moved, which
  // explains what it contradicts: of the rig only what the others say is looked at.
  // True: doubts() has changed.
  bool look(const capture::FrameSet& set, std::span<const object_tracking::ObjectEstimate> estimates,
            std::span<const object_trackers::ObjectTracker> trackers, const std::vector<bool>& moved);

  // Of the last look(), per target: ViewWatch::late_s().
  std::span<const std::vector<double>> late_s() const { return late_s_; }

  // In force now, per target.
  std::span<const std::vector<view_watch::Mistake>> mistakes() const { return mistakes_; }

  // Per camera of the rig: how far it is held to be turned, standard deviation on each of its axes, radians. 0: as the
  // rig's own uncertainty has it.
  const std::vector<double>& doubts() const { return doubts_; }

 private:
  void doubt(const view_watch::Mistake& mistake);

  calib::CameraRig rig_;
  std::vector<view_watch::ViewWatch> watches_;
  std::vector<std::vector<view_watch::Mistake>> mistakes_;
  std::vector<std::vector<double>> late_s_;
  std::vector<double> doubts_, doubts_before_;
};

// By how much a camera that a mistake names looks elsewhere than the rig says, radians: what was found, as the error of
// any direction, for of a few places its direction is hardly known. 0: nothing that a turn could stand for.
double doubt_of(const view_watch::Mistake& mistake, const calib::Camera& camera);

// Adds it to what is held of the cameras. trust: per camera of the rig.
void add_doubts(std::span<const double> doubts, std::vector<object_tracking::CameraTrust>& trust);

}  // namespace huetrack::pipeline
