// Writes a recording that replays to exactly the frames that were written: a folder with recording.yaml, the rig, the
// configuration, and per camera a Matroska file and a CSV of exact capture times (service/recordings/README.md). Also
// the pre-roll: the last seconds in memory, to be written after an event.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "capture/frames/capture_error.h"
#include "capture/frames/frame.h"

namespace huetrack::recordings {

// How raw (not JPEG) images are stored; both lossless. Figures: EXPERIMENTS.md.
enum class RawStorage : std::uint8_t {
  uncompressed,  // 18 MB/s for 640x480 YUYV at 30 frames/s
  huffyuv,       // about half of that for 1 ms of a core per frame. yuyv replays as i422, nv12 as i420, with the same
                 // pixel values
};

struct RecordingOptions {
  std::filesystem::path folder;        // created; must not exist yet, or be empty
  std::vector<std::string> cameras;    // names; Frame::camera indexes it
  std::vector<bool> are_matches = {};  // per camera: its frames carry matches (Frame::matches); empty: none do
  std::string rig_yaml;                // text of the rig file, becomes rig.yaml; empty: none
  std::string config_yaml;             // the resolved configuration, becomes huetrackd.yaml; empty: none
  std::vector<std::pair<std::string, std::string>> files = {};  // name and content of files that huetrackd.yaml names
  RawStorage raw_storage = RawStorage::uncompressed;
  capture::Duration flush_every = std::chrono::milliseconds(250);  // > 0; largest loss on kill -9
  std::vector<std::string> problems() const;                       // empty when valid
};

struct RecordedCameraFigures {
  std::uint64_t frames = 0;  // written, corrupted ones included
  // Skipped: stamp not later than the previous; format or size not that of the first; BGR.
  std::uint64_t left_out = 0;
  std::uint64_t bytes = 0;  // of video, so far
};

// Different cameras may be written by different threads at once, but each camera by one thread at a time. write()
// computes and blocks on the disk: call it from threads behind bounded queues, never from the tracking thread.
// figures(), failure() are thread-safe.
class RecordingWriter {
 public:
  // Writes recording.yaml, rig.yaml, huetrackd.yaml and the time-stamp files' headers, so that a killed recording
  // replays. throws CaptureError: the folder cannot be created or is not empty; std::invalid_argument:
  // options.problems()
  explicit RecordingWriter(RecordingOptions options);
  ~RecordingWriter();  // finish()

  // Appends to the camera's file; for MJPEG the camera's own bytes (Frame::encoded). After the first failure: false,
  // for every camera: see failure(). What was written before replays. Does not throw.
  bool write(const capture::Frame& frame);
  // One line, "/data/run7/left.mkv: No space left on device: recording stopped after 123.4 s, ..."; nullopt: none.
  std::optional<std::string> failure() const;
  std::vector<RecordedCameraFigures> figures() const;
  const std::filesystem::path& folder() const;

  // Closes the files properly (an index for players). Call after all writing threads ended; idempotent. Does not throw.
  void finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct PreRollOptions {
  capture::Duration length = std::chrono::seconds(5);  // > 0; how far back it goes, by capture time
  std::size_t most_bytes = std::size_t{256} << 20;     // > 0; of all cameras; the oldest frames go first
  std::vector<std::string> problems() const;
};

// The last seconds of frames. Keeps JPEG frames compressed and copies raw ones, so that drivers get their
// buffers back. thread-compatible.
class PreRoll {
 public:
  explicit PreRoll(PreRollOptions options);  // throws std::invalid_argument: options.problems()
  void push(const capture::Frame& frame);
  // Removes and returns all frames, in the order pushed: pass them to RecordingWriter::write() before the live frames.
  // Frames of JPEG cameras have `encoded` but no pixels.
  std::vector<capture::Frame> take();
  std::size_t bytes() const { return bytes_; }
  std::size_t size() const { return frames_.size(); }
  capture::Duration length() const {  // from the oldest frame to the newest
    return frames_.empty() ? capture::Duration::zero() : *newest_ - frames_.front().frame.captured_at;
  }
  // The actual length if most_bytes limits it; nullopt: not limited.
  std::optional<capture::Duration> cut_to() const { return cut_to_; }

 private:
  struct Held {
    capture::Frame frame;
    std::size_t bytes = 0;
  };
  void shrink();

  PreRollOptions options_;
  std::deque<Held> frames_;
  std::optional<capture::Timestamp> newest_;
  std::optional<capture::Duration> cut_to_;
  std::size_t bytes_ = 0;
};

}  // namespace huetrack::recordings
