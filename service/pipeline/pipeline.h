// The path of a frame, with all threads:
//
//   capture threads (one per source)      tracking thread                              picture thread
//   source -> [pace] -> synchroniser -> queue -> trackers (+ workers) -> outputs -> queue -> outputs' pictures
//                    `-> queue -> camera tracker -> outputs       (camera thread) -> queue -> outputs' pictures
//
// Once the outputs have a set's positions, the trackers learn from its frames what only later sets need (learn()).
// Data flows one way. A stop propagates downstream: the sources end, the queue closes, tracking drains it.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "calib/model/camera_rig.h"
#include "camera_tracking/camera_tracker.h"
#include "capture/frames/frame_source.h"
#include "capture/frames/repeat_watch.h"
#include "capture/timing/frame_synchronizer.h"
#include "object_tracking/trackers/object_tracker.h"
#include "pictures/picture_job.h"
#include "pipeline/bounded_queue.h"
#include "pipeline/calibration_watch.h"
#include "pipeline/mistake_watch.h"
#include "pipeline/output.h"

namespace huetrack::pipeline {

// Releases frames at the pace of their capture times: `first` at `start`.
struct Pace {
  std::chrono::steady_clock::time_point start;
  capture::Timestamp first;
};

struct PipelineOptions {
  capture::FrameSynchronizerOptions frame_sets = {};
  WhenFull when_full = WhenFull::wait;
  std::size_t queue_capacity = 8;  // frame sets between capture and tracking
  int threads = 1;                 // for tracking; the result does not depend on it
  // Sets (FrameSet::at) and frames of the tracked camera (captured_at) to skip, ascending: those that were dropped
  // live.
  std::vector<capture::Timestamp> left_out = {}, camera_left_out = {};
  // Every n-th set and frame of the tracked camera goes to the outputs as a picture; 0: none.
  int pictures_every = 0;
};

// thread-compatible; run() once.
class Pipeline {
 public:
  // One tracker per target. sources yield frames whose `camera` indexes rig.cameras.
  Pipeline(const calib::CameraRig& rig, std::vector<std::unique_ptr<capture::FrameSource>> sources,
           std::vector<object_trackers::ObjectTracker> trackers, PipelineOptions options);
  ~Pipeline();

  // After run(): closes the cameras before destruction.
  void close_sources();

  // Before run(). Outputs are called in the order of add(), and outlive run().
  void add(Output& output) { outputs_.push_back(&output); }
  // Before run(): limits the pace; by default, as fast as the sources deliver.
  void hold_to(const Pace& pace) { pace_ = pace; }

  // Returns when every source has ended, or soon after a stop. All frames received before the stop are tracked and
  // output, so a recording of them gives the same track. Rethrows exceptions of outputs and sources; throws
  // std::runtime_error if a camera's frames do not have the rig's size.
  void run(std::stop_token stop);

  // Before run(): called on the tracking thread before each set's trackers, which use its trust().
  void watch_calibration(CalibrationWatch watch) { calibration_.emplace(std::move(watch)); }
  // Before run(): called on the tracking thread after each set's trackers, which use its inflation() from the next set
  // on.
  void watch_mistakes(MistakeWatch watch) { mistakes_.emplace(std::move(watch)); }
  const CalibrationWatch* calibration() const { return calibration_ ? &*calibration_ : nullptr; }  // after run()

  // Before run(): all frames of this camera of the rig go to the tracker, independent of frame sets.
  void track_camera(int camera, std::unique_ptr<camera_tracking::CameraTracker> tracker);
  const camera_tracking::CameraTracker* camera_tracker() const { return camera_tracker_.get(); }  // after run()

  PipelineFigures figures() const;              // thread-safe
  TrackedCameraFigures tracked_camera() const;  // thread-safe; of figures()

  // New trackers for some targets.
  struct Replacement {
    struct OfTarget {
      std::size_t target;  // index
      object_tracking::TargetOptions options;
      object_trackers::ObjectTracker tracker;
    };
    std::vector<OfTarget> trackers;
    std::optional<capture::Timestamp> from;  // the first set (FrameSet::at); nullopt: the next one
    std::string config = {};                 // for TrackedSet::reloaded of that set; empty: none
  };
  void replace_trackers(Replacement replacement);  // skips no set. thread-safe

 private:
  struct ReadySet {
    capture::FrameSet set;
    capture::Timestamp received_at;
  };

  struct ReadyFrame {
    capture::Frame frame;
    capture::Timestamp received_at;
  };

  class TrackingTeam;

  void capture(capture::FrameSource& source, std::stop_token stop);
  void receive(capture::Frame frame);
  void put_in_queue(ReadySet ready);  // synchronizer_mutex_ is held
  void put_in_camera_queue(ReadyFrame ready);
  void track();
  void update(ReadySet ready, TrackingTeam& team, std::vector<object_tracking::ObjectEstimate>& estimates);
  bool is_picture(std::uint64_t index) const;
  void output_status();
  void update_searches();
  static void forget_searches(const Replacement& next, std::vector<objects::SearchFindings>& searches);
  void set_ended(std::size_t camera, bool has_ended);  // figures_mutex_ is held
  bool take_replacements(capture::Timestamp at);       // returns whether there were any
  bool has_jumped(std::deque<capture::Timestamp>& jumps, capture::Timestamp at);
  void begin_anew_after_jumps(capture::Timestamp at);
  void watch(const capture::FrameSet& set, bool has_new_trackers);
  void trust_cameras();
  void watch_mistakes(const capture::FrameSet& set, std::span<const object_tracking::ObjectEstimate> estimates);
  std::vector<bool> moved_cameras() const;
  template <typename Job>
  void draw(BoundedQueue<Job>& jobs, void (Output::*on_job)(const Job&));
  void track_camera_frames();
  template <typename F>
  void guarded(F&& thread_body);  // an exception stops the pipeline

  const calib::CameraRig& rig_;
  std::vector<std::unique_ptr<capture::FrameSource>> sources_;
  std::vector<object_trackers::ObjectTracker> trackers_;  // the tracking thread's and its workers'
  const PipelineOptions options_;
  std::optional<Pace> pace_;
  std::optional<CalibrationWatch> calibration_;  // the tracking thread's while it runs
  std::optional<MistakeWatch> mistakes_;         // the tracking thread's while it runs
  bool is_inflation_new_ = false;                // the tracking thread's: not passed to the trackers yet
  std::vector<Output*> outputs_;
  std::stop_source stop_;
  BoundedQueue<ReadySet> frame_sets_;
  BoundedQueue<pictures::PictureJob> pictures_;

  int tracked_camera_ = -1;
  std::unique_ptr<camera_tracking::CameraTracker> camera_tracker_;  // the camera thread's while it runs
  BoundedQueue<ReadyFrame> camera_frames_;
  BoundedQueue<pictures::CameraPictureJob> camera_pictures_;

  std::mutex synchronizer_mutex_;              // also held while sets enter the queue, which keeps their order
  capture::FrameSynchronizer synchronizer_;    // guarded by synchronizer_mutex_
  std::vector<capture::RepeatWatch> repeats_;  // per camera, used by its capture thread
  std::vector<bool> size_checked_;             // guarded by synchronizer_mutex_
  std::uint64_t arrivals_ = 0;                 // guarded by synchronizer_mutex_

  std::mutex replacements_mutex_;
  std::deque<Replacement> replacements_;  // guarded by replacements_mutex_
  // Guarded by replacements_mutex_: first capture times after a source's jump, for each of both tracking threads.
  std::deque<capture::Timestamp> jumps_, camera_jumps_;
  std::vector<std::string> reloaded_;  // the tracking thread's: TrackedSet::reloaded

  mutable std::mutex figures_mutex_;  // never held while waiting
  PipelineFigures figures_;           // guarded by figures_mutex_
  int camera_news_ = 0;               // guarded by figures_mutex_; number of camera starts and ends
  std::exception_ptr error_;          // guarded by figures_mutex_; the first one
};

}  // namespace huetrack::pipeline
