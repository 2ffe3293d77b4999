// The road of a frame, and every thread of the service:
//
//   capture threads (one per source)      tracking thread                              picture thread
//   source -> [pace] -> synchroniser -> queue -> trackers (+ workers) -> estimates out -> queue -> pictures out
//                    `-> queue -> camera tracker -> poses out            (camera thread) -> queue -> pictures out
//
// Nothing calls back up. Stopping goes from upstream down: the sources end, the queue closes, tracking drains it.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stop_token>
#include <utility>
#include <vector>

#include "calib/model/camera_rig.h"
#include "camera_tracking/camera_tracker.h"
#include "capture/frame_source.h"
#include "capture/frame_synchronizer.h"
#include "object_tracking/object_tracker.h"
#include "pictures/picture_job.h"
#include "pipeline/bounded_queue.h"
#include "pipeline/tracked_camera.h"

namespace huetrack::pipeline {

// What a stage took so far. Waiting (for a paced frame, for room in a queue) is not counted.
struct StageTime {
  capture::Duration wall{0};
  capture::Duration cpu{0};  // of our threads; threads inside libraries (decoders) are not seen
};

struct CameraFigures {
  std::uint64_t frames = 0;     // with an image
  std::uint64_t dropped = 0;    // sequence gaps
  std::uint64_t corrupted = 0;  // came, but damaged
  std::optional<std::uint32_t> last_sequence;
  std::optional<std::chrono::steady_clock::time_point> last_received;  // with an image
  std::optional<capture::Timestamp> last_captured;                     // the source's clock
  bool ended = false;                                                  // its source has no more of it
};

// A snapshot of what has happened so far.
struct PipelineFigures {
  std::vector<CameraFigures> cameras;  // in the order of the rig
  capture::FrameSynchronizerCounters frame_sets;
  std::uint64_t sets_tracked = 0;
  std::uint64_t sets_dropped = 0;  // by the queue, because tracking was too slow
  StageTime decode, synchronise, track, publish, draw;
  std::vector<object_tracking::SearchFindings> searches;  // per target, about once a second and at the end
  std::uint64_t camera_frames_tracked = 0;
  std::uint64_t camera_frames_dropped = 0;  // by the queue, because camera tracking was too slow
  StageTime camera_track;
  TrackedCameraFigures tracked_camera;
  StageTime track_first;  // part of track: the first set, for which the trackers build colour tables
  std::chrono::steady_clock::time_point tracking_round{};  // when the tracking thread last came round: once a second
};

// Frames are held back until their capture time: `first` is let through at `start`.
struct Pace {
  std::chrono::steady_clock::time_point start;
  capture::Timestamp first;
  const std::atomic<std::int64_t>* delay_ns = nullptr;  // is added to start; may change while nothing is let through
};

struct PipelineOptions {
  capture::FrameSynchronizerOptions frame_sets;
  WhenFull when_full = WhenFull::wait;
  std::size_t queue_capacity = 8;  // frame sets between capture and tracking
  int threads = 1;                 // that track; the result does not depend on it
  std::optional<Pace> pace;        // nullopt: as fast as frames come
  std::vector<capture::Timestamp>
      left_out;  // ascending; sets (FrameSet::at) that are not tracked: a replay of what live dropped
  std::vector<capture::Timestamp> camera_left_out;  // ascending; likewise, frames (captured_at) of the tracked camera
  int pictures_every = 1;                           // >= 1; every how many-th set goes to the picture output
  std::size_t view_particles = 0;  // about so many of each target's particles go to the view output; 0: all
};

// Where the results go; an empty function is left out. An exception out of one of them stops the pipeline and comes out
// of run(). Each is called from one thread only.
struct PipelineOutputs {
  // Tracking thread; sets in time order, estimates in target order. received_at: UNIX time, when the last frame came.
  std::function<void(const capture::FrameSet&, std::span<const object_tracking::ObjectEstimate>,
                     capture::Timestamp received_at)>
      estimates;
  // Tracking thread; once a second, when a camera starts or ends, and a last time at the end.
  std::function<void(const PipelineFigures&)> status;
  // Picture thread. It may be slow: replay waits for it, the estimates of the same set are out before.
  std::function<void(const pictures::PictureJob&)> pictures;
  // Capture threads, one at a time: a set that will not be tracked, because tracking is too slow. Must be quick.
  std::function<void(const capture::FrameSet&)> left_out = nullptr;
  std::function<void(const capture::Frame&)> camera_left_out = nullptr;  // the same, of the tracked camera's frames
  // Camera thread: a pose per frame of the tracked camera. received_at: UNIX time.
  std::function<void(const camera_tracking::CameraEstimate&, capture::Timestamp received_at)> camera_poses = nullptr;
  // Camera thread, after camera_poses: whether the map is wanted by who watches, and then the map. Both must be quick.
  std::function<bool()> camera_map_wanted = nullptr;
  std::function<void(camera_tracking::CameraMap)> camera_map = nullptr;
  // Camera picture thread; every options.pictures_every-th frame.
  std::function<void(const pictures::CameraPictureJob&)> camera_pictures = nullptr;
  // Tracking thread, after `estimates`: whether a picture of this set is wanted by who watches, and then the set. Both
  // must be quick: they are on the road.
  std::function<bool()> view_wanted = nullptr;
  std::function<void(pictures::PictureJob)> view = nullptr;
  // Capture threads, one at a time, before the frame enters the synchroniser and in that order (Frame::arrival): must
  // be quick, everything waits for it. received_at: UNIX time.
  std::function<void(const capture::Frame&, capture::Timestamp received_at)> frames = nullptr;
};

// thread-compatible; run() once.
class Pipeline {
 public:
  // One tracker per target. sources yield frames whose `camera` indexes rig.cameras.
  Pipeline(const calib::CameraRig& rig, std::vector<std::unique_ptr<capture::FrameSource>> sources,
           std::vector<object_tracking::ObjectTracker> trackers, PipelineOptions options, PipelineOutputs outputs);
  ~Pipeline();

  // Returns when every source has ended, or soon after a stop: every set that was tracked is then out, none in part.
  // What had been received when the stop came is tracked, too: a recording of the same frames gives the same track.
  // throws what an output or a source threw, or std::runtime_error when a camera's frames have not the rig's size.
  void run(std::stop_token stop);

  // Call it before run(): frames of this camera of the rig go to the tracker, too, whatever frame sets they are in.
  void track_camera(int camera, std::unique_ptr<camera_tracking::CameraTracker> tracker);
  const camera_tracking::CameraTracker* camera_tracker() const { return camera_tracker_.get(); }  // when run() is over

  PipelineFigures figures() const;              // thread-safe
  TrackedCameraFigures tracked_camera() const;  // thread-safe; of figures(), and in camera_poses those of that frame

  // Trackers that take the place of those of their targets.
  struct Replacement {
    std::vector<std::pair<std::size_t, object_tracking::ObjectTracker>> trackers;  // targets' indices
    std::optional<capture::Timestamp> from;  // the first set (FrameSet::at); nullopt: the next one
    std::function<void(capture::Timestamp)> done =
        nullptr;  // tracking thread, before that set is tracked; its FrameSet::at
  };
  void replace_trackers(Replacement replacement);  // no set is lost. thread-safe

 private:
  struct ReadySet {
    capture::FrameSet set;
    capture::Timestamp received_at;
  };

  struct ReadyFrame {
    capture::Frame frame;
    capture::Timestamp received_at;
  };

  void capture(capture::FrameSource& source, std::stop_token stop);
  void receive(capture::Frame frame);
  void put_in_queue(ReadySet ready);  // synchronizer_mutex_ is held
  void put_in_camera_queue(ReadyFrame ready);
  pictures::PictureJob picture_of(capture::FrameSet set, std::vector<object_tracking::ObjectEstimate> estimates,
                                  std::size_t particles) const;
  void track();
  void note_searches();
  void take_replacements(capture::Timestamp at);
  void draw();
  void track_camera_frames();
  void draw_camera();
  template <typename F>
  void guarded(F&& thread_body);  // an exception stops everything

  const calib::CameraRig& rig_;
  std::vector<std::unique_ptr<capture::FrameSource>> sources_;
  std::vector<object_tracking::ObjectTracker> trackers_;  // the tracking thread's and its workers'
  const PipelineOptions options_;
  const PipelineOutputs outputs_;
  std::stop_source stop_;
  BoundedQueue<ReadySet> frame_sets_;
  BoundedQueue<pictures::PictureJob> pictures_;

  int tracked_camera_ = -1;
  std::unique_ptr<camera_tracking::CameraTracker> camera_tracker_;  // the camera thread's while it runs
  BoundedQueue<ReadyFrame> camera_frames_;
  BoundedQueue<pictures::CameraPictureJob> camera_pictures_;

  std::mutex synchronizer_mutex_;            // held while sets go into the queue too, which keeps their order
  capture::FrameSynchronizer synchronizer_;  // guarded by synchronizer_mutex_
  std::vector<bool> size_checked_;           // guarded by synchronizer_mutex_
  std::uint64_t arrivals_ = 0;               // guarded by synchronizer_mutex_

  std::mutex replacements_mutex_;
  std::deque<Replacement> replacements_;  // guarded by replacements_mutex_

  mutable std::mutex figures_mutex_;  // never held while waiting
  PipelineFigures figures_;           // guarded by figures_mutex_
  std::exception_ptr error_;          // guarded by figures_mutex_; the first one
};

}  // namespace huetrack::pipeline
