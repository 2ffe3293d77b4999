// The interface for consumers of results: a file, DDS, the web page, a summary. The pipeline calls its outputs in the
// order in which they were added.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "camera_tracking/camera_tracker.h"
#include "capture/frames/frame.h"
#include "config/service_config.h"
#include "object_tracking/trackers/object_tracker.h"
#include "pictures/picture_job.h"
#include "pipeline/calibration_watch.h"
#include "pipeline/figures.h"
#include "view_watch/view_watch.h"

namespace huetrack::pipeline {

// A frame set and its estimates. Valid during the call.
struct TrackedSet {
  const capture::FrameSet& frames;
  std::span<const object_tracking::ObjectEstimate> estimates;  // in target order; one or more of each
  capture::Timestamp received_at;                              // UNIX time of the arrival of the set's last frame
  std::span<const object_trackers::ObjectTracker> trackers;    // in target order
  std::span<const CameraCalibration> calibration = {};         // per camera of the rig; empty: not watched
  // Currently detected, in target order; empty: not watched.
  std::span<const std::vector<view_watch::Mistake>> mistakes = {};
  // Configurations (YAML) that took effect with this set.
  std::span<const std::string> reloaded = {};

  // Data for a picture of the set, with about `particles` of each target's particles; 0: all. Images are shared; the
  // last owner frees them.
  pictures::PictureJob picture(std::size_t particles) const;
};

// A frame of the tracked camera and its pose estimate. Valid during the call.
struct TrackedFrame {
  const camera_tracking::CameraEstimate& estimate;
  capture::Timestamp received_at;  // UNIX time
  const TrackedCameraFigures& camera;
  const camera_tracking::CameraTracker& tracker;
};

// A set or frame that was dropped because tracking is too slow.
struct LeftOut {
  capture::Timestamp at;      // FrameSet::at, or Frame::captured_at
  bool is_of_camera = false;  // a frame of the tracked camera; otherwise a set
};

// Each function names its calling thread. All but on_picture(), on_camera_picture(), on_config() and flush() delay
// tracking, so slow work belongs to another thread. An exception stops the pipeline and is rethrown by its run().
class Output {
 public:
  virtual ~Output() = default;

  // Capture threads, one at a time, in the order in which frames enter the synchroniser (Frame::arrival).
  // received_at: UNIX time.
  virtual void on_frame(const capture::Frame& /*frame*/, capture::Timestamp /*received_at*/) {}
  // Capture threads, one at a time.
  virtual void on_left_out(const LeftOut& /*left_out*/) {}
  // Tracking thread; sets in time order.
  virtual void on_set(const TrackedSet& /*set*/) {}
  // Tracking thread; once a second, when a camera starts or ends, and at the end.
  virtual void on_status(const PipelineFigures& /*figures*/) {}
  // Camera thread; every frame of the tracked camera.
  virtual void on_camera_pose(const TrackedFrame& /*frame*/) {}
  // Picture threads, one for sets and one for the tracked camera; every PipelineOptions::pictures_every-th. May be
  // slow: a replay waits for them. The set's estimates were published before.
  virtual void on_picture(const pictures::PictureJob& /*job*/) {}
  virtual void on_camera_picture(const pictures::CameraPictureJob& /*job*/) {}

  // The reloading thread: this configuration is now in force.
  virtual void on_config(const config::ServiceConfig& /*config*/) noexcept {}
  // The session's thread, after the run: write everything to disk.
  virtual void flush() {}
};

}  // namespace huetrack::pipeline
