// Records while the service runs: one writing thread per camera behind a bounded queue. A slow disk drops recorded
// frames, which are counted, and never delays tracking.
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
  recordings::RecordingOptions recording;              // without its folder: an argument of start() and save_pre_roll()
  std::size_t queue_frames = 32;                       // per camera, > 0; beyond it the oldest is dropped
  std::optional<recordings::PreRollOptions> pre_roll;  // most_bytes: for all cameras together; nullopt: none
};

struct RecorderFigures {
  std::vector<recordings::RecordedCameraFigures> cameras;  // of the current or last recording
  std::vector<std::uint64_t> dropped;                      // per camera, by the queues and at the end
  std::optional<capture::Duration> pre_roll_that_fits;     // length that fits into memory; nullopt: all
  std::optional<capture::Duration> pre_roll_held;          // of the camera that holds least; nullopt: no pre-roll
  std::optional<std::string> failure;                      // why the current or last recording failed
};

// offer() is thread-safe per camera; figures() is thread-safe; all else: one supervising thread.
class Recorder {
 public:
  explicit Recorder(RecorderOptions options);  // throws std::invalid_argument
  ~Recorder();                                 // finish()

  // Records all frames from now on into this folder, preceded by the pre-roll if there is one and it is wanted. throws
  // CaptureError
  void start(const std::filesystem::path& folder, bool with_pre_roll = true);
  // A recording that save_pre_roll() began continues until stop().
  void go_on() { until_.reset(); }
  // Ends the recording without the frames that are still queued. Does not block.
  void stop();

  // Records the pre-roll and all frames for the duration `after` into this folder. During a recording, only extends it
  // and returns false. throws CaptureError
  bool save_pre_roll(const std::filesystem::path& folder, capture::Duration after);
  void end_when_due();  // call regularly: ends what save_pre_roll() began. Does not block.
  bool is_recording() const;
  bool is_ending_by_itself() const { return is_recording() && until_; }  // begun by save_pre_roll()
  // Recording, or its files are not closed yet.
  bool is_unfinished() const { return unfinished_ > 0; }

  void offer(const capture::Frame& frame);  // fast: queues a reference
  RecorderFigures figures() const;
  // Later recordings contain this configuration.
  void take_over(std::string config_yaml) { options_.recording.config_yaml = std::move(config_yaml); }
  // Writes the queued frames; those left after `patience` are dropped and counted. Idempotent.
  void finish(capture::Duration patience = std::chrono::hours(1));

 private:
  struct Camera {
    Camera(const RecorderOptions& options, std::size_t cameras);
    BoundedQueue<capture::Frame> waiting;
    std::optional<recordings::PreRoll> pre_roll;  // the writing thread's
    std::atomic<std::int64_t> fits_ns = -1;       // of the pre-roll; -1: all
    std::atomic<std::int64_t> held_ns = -1;       // of the pre-roll, now; -1: this camera has given no frame
    std::atomic<std::uint64_t> given_up = 0;      // frames dropped by finish()
    std::atomic<bool> is_done = false;            // the thread has finished
    std::atomic<int> has_begun = 0;               // value of opened_ of the recording whose pre-roll is written
    std::jthread thread;
  };
  void write(Camera& camera);
  std::shared_ptr<recordings::RecordingWriter> writer() const;
  void open(const std::filesystem::path& folder);
  void close();

  RecorderOptions options_;          // the supervising thread's
  std::atomic<int> unfinished_ = 0;  // existing writers; declared before writer_, whose deleter counts it down
  mutable std::mutex mutex_;
  std::shared_ptr<recordings::RecordingWriter> writer_;         // guarded by mutex_; its last owner finishes it
  std::atomic<bool> has_writer_ = false;                        // writer_ != nullptr, for offer()
  std::atomic<int> opened_ = 0;                                 // recordings so far
  std::atomic<bool> leaves_pre_roll_out_ = false;               // in the current recording
  RecorderFigures last_;                                        // guarded by mutex_; of the previous recording
  std::optional<std::chrono::steady_clock::time_point> until_;  // the supervising thread's; nullopt: no end
  std::vector<std::unique_ptr<Camera>> cameras_;                // last: their threads use the rest
};

}  // namespace huetrack::pipeline
