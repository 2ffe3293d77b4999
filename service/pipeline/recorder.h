// Recording while the service runs: one writing thread per camera behind a bounded queue, so that a slow disk costs
// recorded frames, which are counted, and never holds tracking up.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "pipeline/bounded_queue.h"
#include "recordings/recording_writer.h"

namespace huetrack::pipeline {

struct RecorderOptions {
  recordings::RecordingOptions recording;  // but its folder, which start() and save_pre_roll() name
  std::size_t queue_frames = 32;  // per camera, > 0; more than that are waiting for the disk: the oldest is dropped
  std::optional<recordings::PreRollOptions> pre_roll;  // most_bytes is of all cameras; nullopt: none
};

struct RecorderFigures {
  std::vector<recordings::RecordedCameraFigures> cameras;  // of the current or last recording
  std::vector<std::uint64_t> dropped;                      // per camera, by the queues and at the end
  std::optional<capture::Duration> pre_roll_that_fits;  // so much of the pre-roll's length has room; nullopt: all of it
  std::optional<std::string> failure;  // why the current or last recording stopped; nullopt: it did not
};

// offer() is thread-safe per camera; figures() is thread-safe; the rest is for one supervising thread.
class Recorder {
 public:
  explicit Recorder(RecorderOptions options);  // throws std::invalid_argument
  ~Recorder();                                 // finish()

  // Every frame from now on goes into this folder, after the pre-roll where there is one and it is wanted. throws
  // CaptureError
  void start(const std::filesystem::path& folder, bool with_pre_roll = true);
  // What save_pre_roll() began goes on until stop().
  void go_on() { until_.reset(); }
  // What is recorded ends here. What the queues hold is not in it any more. Does not block.
  void stop();

  // The pre-roll and what comes in the time `after` from now go into this folder. While that is going on, another call
  // only makes it longer, and gives false. throws CaptureError
  bool save_pre_roll(const std::filesystem::path& folder, capture::Duration after);
  void end_when_due();  // call it now and then: ends what save_pre_roll() began. Does not block.
  bool is_recording() const;
  bool is_ending_by_itself() const { return is_recording() && until_; }  // as save_pre_roll() began it
  // A recording is written, or was ended a moment ago and its files are not closed yet.
  bool is_unfinished() const { return unfinished_ > 0; }

  void offer(const capture::Frame& frame);  // quick: a reference into a queue
  RecorderFigures figures() const;
  // Recordings begun from now on hold this configuration.
  void take_over(std::string config_yaml) { options_.recording.config_yaml = std::move(config_yaml); }
  // What is in the queues is written; what is still there after `patience` is left out, and counted. Idempotent.
  void finish(capture::Duration patience = std::chrono::hours(1));

 private:
  struct Camera {
    Camera(const RecorderOptions& options, std::size_t cameras);
    BoundedQueue<capture::Frame> waiting;
    std::optional<recordings::PreRoll> pre_roll;  // the writing thread's
    std::atomic<std::int64_t> fits_ns = -1;       // of the pre-roll; -1: all
    std::atomic<std::uint64_t> given_up = 0;      // frames, at the end
    std::atomic<bool> is_done = false;            // the thread has written all
    std::atomic<int> has_begun = 0;  // the recording, as opened_ counts them, whose pre-roll it has written
    std::jthread thread;
  };
  void write(Camera& camera);
  std::shared_ptr<recordings::RecordingWriter> writer() const;
  void open(const std::filesystem::path& folder);
  void close();

  RecorderOptions options_;          // the supervising thread's
  std::atomic<int> unfinished_ = 0;  // writers that there are; before writer_, whose end counts it down
  mutable std::mutex mutex_;
  std::shared_ptr<recordings::RecordingWriter> writer_;         // guarded by mutex_; who lets go of it last finishes it
  std::atomic<bool> has_writer_ = false;                        // as writer_, for offer()
  std::atomic<int> opened_ = 0;                                 // recordings so far
  std::atomic<bool> leaves_pre_roll_out_ = false;               // of what is recorded now
  RecorderFigures last_;                                        // guarded by mutex_; of the recording before
  std::optional<std::chrono::steady_clock::time_point> until_;  // the supervising thread's; nullopt: for ever
  std::vector<std::unique_ptr<Camera>> cameras_;                // last: their threads use the rest
};

}  // namespace huetrack::pipeline
