// A recording as a source of frames.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/frames/frame_source.h"
#include "recordings/recording.h"

namespace huetrack::recordings {

struct ReplayOptions {
  int decoder_threads = 1;  // >= 1; slices of one frame that are decoded at once. Changes the speed, never the frames.
  // Beside camera_names: what is known of when each camera's rows are exposed. Empty: nothing of any camera.
  std::vector<capture::FrameTiming> timing = {};
  bool keeps_encoded = false;  // JPEGs carry their own bytes, too (Frame::encoded), as a live camera's do
  // Frames may say which pixels match, and have no pixels (Frame::matches). Without it, a camera that was recorded so
  // is refused.
  bool takes_matches = false;
  std::vector<std::string> problems() const;
};

// One camera of a replay.
struct ReplayCamera {
  std::string name;
  std::filesystem::path file;  // or pattern
  int width = 0;               // pixels, of every frame
  int height = 0;
  capture::PixelFormat format = capture::PixelFormat::grey;  // of the first frame
  capture::ColorRange range = capture::ColorRange::limited;
  capture::Duration frame_period{0};            // usual time between two frames; 0 when unknown
  std::optional<capture::Timestamp> first_at;   // capture time of the first frame; nullopt: the camera delivered none
  std::optional<std::int64_t> expected_frames;  // as far as the file and the time stamps tell before all is read
  std::int64_t frames = 0;                      // handed out with an image, so far
  std::int64_t corrupted = 0;                   // handed out without one: they do not decode
  std::int64_t missing = 0;                     // not in the recording: gaps in the numbering of frames
};

// All cameras of a recording, merged by capture time (equal times: in the order of camera_names), the same frames in
// the same order every time. Nothing waits for a clock: who wants real time sleeps until a frame is due.
//
// Recorded time stamps are smoothed by a CameraClock, as those of the live camera are; times that follow from `fps` and
// those that our own recorder smoothed already (column stamp_s) are taken as they are.
// Images come in the file's own pixel format, not converted, where PixelFormat has it; otherwise in the nearest one
// (README.md). A corrupted frame comes with its time and number, status corrupted and an empty image.
// thread-compatible.
class ReplaySource final : public capture::FrameSource {
 public:
  // camera_names: Frame::camera indexes it. Opens every file and decodes its first frame.
  // throws ConfigError: a camera that the recording lacks, a file that is not there, not a video or without any frame.
  // throws std::invalid_argument: options.problems()
  ReplaySource(const Recording& recording, std::span<const std::string> camera_names,
               const ReplayOptions& options = {});
  ~ReplaySource() override;

  std::optional<capture::Frame> next(
      std::stop_token stop) override;     // returns within one frame's decoding time of a stop
  bool ended(int camera) const override;  // known when the frame after its last is out

  const std::vector<ReplayCamera>& cameras() const;     // in the order of camera_names
  std::optional<std::int64_t> expected_frames() const;  // of all cameras
  std::optional<capture::Timestamp> first_at() const;   // of all cameras; nullopt: none delivered anything
  std::vector<std::string> take_warnings();             // those that arose since the last call, one line each

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::recordings
