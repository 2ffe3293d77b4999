// Where results go. A file, the bus, the page, a summary: each is a class that takes from the road what it is for. The
// road calls its outputs in the order in which they were added.
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

// A frame set and what was found in it. Lent for the call.
struct TrackedSet {
  const capture::FrameSet& frames;
  std::span<const object_tracking::ObjectEstimate> estimates;  // in target order; one or more of each
  capture::Timestamp received_at;                              // UNIX time, when the set's last frame came
  std::span<const object_trackers::ObjectTracker> trackers;    // in target order
  std::span<const CameraCalibration> calibration = {};         // per camera of the rig; empty: it is not watched
  // That are in force with this set, in target order; empty: they are not looked for.
  std::span<const std::vector<view_watch::Mistake>> mistakes = {};
  // Configurations (YAML) that took effect with this set, nearly always none.
  std::span<const std::string> reloaded = {};

  // What a picture of the set needs, with about `particles` of each target's particles, 0: all. Images are shared: who
  // keeps them longest frees them, or gives them back to a driver.
  pictures::PictureJob picture(std::size_t particles) const;
};

// A frame of the tracked camera and what it told. Lent for the call.
struct TrackedFrame {
  const camera_tracking::CameraEstimate& estimate;
  capture::Timestamp received_at;  // UNIX time
  const TrackedCameraFigures& camera;
  const camera_tracking::CameraTracker& tracker;
};

// What will not be tracked, because tracking is too slow.
struct LeftOut {
  capture::Timestamp at;      // FrameSet::at, or Frame::captured_at
  bool is_of_camera = false;  // a frame of the tracked camera; else a set
};

// Every function but on_config() and flush() is called by one thread of the road, which is named here, and is on the
// road: what may be slow belongs to another thread. An exception stops the pipeline, and comes out of its run().
class Output {
 public:
  virtual ~Output() = default;

  // Capture threads, one at a time, before the frame enters the synchroniser and in that order (Frame::arrival).
  // Everything waits for it. received_at: UNIX time.
  virtual void on_frame(const capture::Frame& /*frame*/, capture::Timestamp /*received_at*/) {}
  // Capture threads, one at a time.
  virtual void on_left_out(const LeftOut& /*left_out*/) {}
  // Tracking thread; sets in time order.
  virtual void on_set(const TrackedSet& /*set*/) {}
  // Tracking thread; once a second, when a camera starts or ends, and a last time at the end.
  virtual void on_status(const PipelineFigures& /*figures*/) {}
  // Camera thread; every frame of the tracked camera.
  virtual void on_camera_pose(const TrackedFrame& /*frame*/) {}
  // Picture threads, one of the sets' and one of the tracked camera's; every PipelineOptions::pictures_every-th. They
  // may be slow: a replay waits for them, and the estimates of the same set are out before.
  virtual void on_picture(const pictures::PictureJob& /*job*/) {}
  virtual void on_camera_picture(const pictures::CameraPictureJob& /*job*/) {}

  // The thread that reloads: this configuration is in force, and nothing can be taken back any more.
  virtual void on_config(const config::ServiceConfig& /*config*/) noexcept {}
  // The thread that has run the session, when the road is empty: what is written is to be on disk.
  virtual void flush() {}
};

}  // namespace huetrack::pipeline
