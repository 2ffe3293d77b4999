// Writes a recording that replays to exactly the frames that were written: a folder with recording.yaml, the rig, the
// configuration, and per camera one Matroska file and one CSV of exact capture times. service/recordings/README.md.
// Also the pre-roll: the last seconds in memory, to be written when something has happened.
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

// How raw (not JPEG) images are stored; both lossless. Figures: service/recordings/README.md.
enum class RawStorage : std::uint8_t {
  uncompressed,  // the bytes as they are: 18 MB/s for 640x480 YUYV at 30 frames/s
  huffyuv,       // about half of it; a millisecond of a core per such frame. yuyv replays as i422, nv12 as i420: the
                 // same pixel values in other places
};

struct RecordingOptions {
  std::filesystem::path folder;      // made; must not exist yet, or be empty
  std::vector<std::string> cameras;  // names; Frame::camera indexes it
  std::vector<bool> are_matches =
      {};                   // per camera: its frames say which pixels match (Frame::matches); empty: none does
  std::string rig_yaml;     // text of the rig file, becomes rig.yaml; empty: none
  std::string config_yaml;  // the resolved configuration, becomes huetrackd.yaml; empty: none
  std::vector<std::pair<std::string, std::string>> files = {};  // what huetrackd.yaml refers to: name and content
  RawStorage raw_storage = RawStorage::uncompressed;
  capture::Duration flush_every = std::chrono::milliseconds(250);  // > 0; what a kill -9 costs at most
  std::vector<std::string> problems() const;                       // empty when valid
};

struct RecordedCameraFigures {
  std::uint64_t frames = 0;  // written, corrupted ones included
  // Not later than the frame before; of another format or size than the first; BGR, which no camera sends.
  std::uint64_t left_out = 0;
  std::uint64_t bytes = 0;  // of video, so far
};

// One camera's frames are written by one thread at a time, different cameras' by different threads at once: so the
// pipeline may own one writing thread per camera, each behind its own bounded queue (service/pipeline/bounded_queue.h,
// WhenFull::drop_oldest). write() blocks on the disk and computes: never call it on the tracking road. What
// the queue drops is the pipeline's to count.
// figures(), failure() are thread-safe.
class RecordingWriter {
 public:
  // Writes recording.yaml, rig.yaml and huetrackd.yaml, and the time-stamp files' headers: what is killed later
  // replays. throws CaptureError: a folder that cannot be made or is not empty; std::invalid_argument:
  // options.problems()
  explicit RecordingWriter(RecordingOptions options);
  ~RecordingWriter();  // finish()

  // Appends it to its camera's file. MJPEG (Frame::encoded): the camera's own bytes. False, now and from then on for
  // every camera: writing has failed, failure() says why; what was written until then replays. Does not throw.
  bool write(const capture::Frame& frame);
  // One line, "/data/run7/left.mkv: No space left on device: recording stopped after 123.4 s, ..."; nullopt: all is
  // well.
  std::optional<std::string> failure() const;
  std::vector<RecordedCameraFigures> figures() const;
  const std::filesystem::path& folder() const;

  // Closes the files properly (an index for players). Once every writing thread is through; idempotent. Does not throw.
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

// The last seconds of frames. JPEG frames keep their own bytes only; raw ones are copied, so that no driver's buffer is
// held. thread-compatible.
class PreRoll {
 public:
  explicit PreRoll(PreRollOptions options);  // throws std::invalid_argument: options.problems()
  void push(const capture::Frame& frame);
  // Everything in it, in the order pushed, and empties it: feed it to RecordingWriter::write() on a writing thread,
  // live frames after it. The frames of JPEG cameras carry encoded and no pixels.
  std::vector<capture::Frame> take();
  std::size_t bytes() const { return bytes_; }
  std::size_t size() const { return frames_.size(); }
  // How far back it goes when most_bytes keeps it from its length; nullopt: it does not.
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
