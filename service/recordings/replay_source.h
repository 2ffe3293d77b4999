// A recording as a source of frames.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/frames/frame_source.h"
#include "recordings/recording.h"

namespace huetrack::recordings {

struct ReplayOptions {
  int decoder_threads = 1;  // >= 1; slices of one frame decoded in parallel. Affects the speed, never the frames.
  std::vector<capture::FrameTiming> timing = {};  // one entry per camera_names; empty: unknown
  bool keeps_encoded = false;                     // JPEGs keep their own bytes (Frame::encoded), as a live camera's do
  bool takes_matches = false;  // accept frames with matches and no pixels (Frame::matches); false: refuse such cameras
  // Called for each contradiction of the recording's times and its files that the frames show, as they are read: it is
  // then among the mistakes, but not among the warnings.
  std::function<void(const std::string&)> on_contradicted_times = {};
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
  bool is_turned = false;             // as a tag of the file says
  bool is_grey = false;               // no picture so far has a colour
  capture::Duration frame_period{0};  // usual time between two frames; 0 when unknown
  // Hz, if all its times are even so far, as those that a program counts: a frame that was dropped is not in them. 0:
  // they vary, or our recorder stored a driver's stamps.
  double even_hz = 0;
  std::optional<capture::Timestamp> first_at;   // capture time of the first frame; nullopt: the camera delivered none
  std::optional<std::int64_t> expected_frames;  // from the file and the time stamps, before all is read
  std::int64_t frames = 0;                      // delivered with an image, so far
  std::int64_t corrupted = 0;                   // delivered without one: they do not decode
  std::int64_t missing = 0;                     // not in the recording: gaps in the frame numbers
};

// All cameras of a recording, merged by capture time (equal times: in the order of camera_names); deterministic. It
// does not wait for frames to be due.
//
// Recorded time stamps are smoothed by a CameraClock, as live ones are; times from `fps`, and those that our recorder
// smoothed already (column stamp_s), are not. Images have the file's own pixel format where PixelFormat has it,
// otherwise the nearest one (capture/design.md). A corrupted frame has its time and number, and an empty image.
// thread-compatible.
class ReplaySource final : public capture::FrameSource {
 public:
  // camera_names: Frame::camera is its index. Opens every file and decodes its first frame.
  // throws ConfigError: a camera is not in the recording, a file does not exist, is not a video, or has no frame;
  // std::invalid_argument: options.problems()
  ReplaySource(const Recording& recording, std::span<const std::string> camera_names,
               const ReplayOptions& options = {});
  ~ReplaySource() override;

  std::optional<capture::Frame> next(std::stop_token stop) override;  // ends within one frame's decoding of a stop
  bool ended(int camera) const override;                              // known once the next frame after its last is out

  const std::vector<ReplayCamera>& cameras() const;     // in the order of camera_names
  std::optional<std::int64_t> expected_frames() const;  // of all cameras
  std::optional<capture::Timestamp> first_at() const;   // of all cameras; nullopt: there are no frames
  std::vector<std::string> take_warnings();             // since the last call, one line each
  // Times of the recording that its files contradict, so far; one line each, which are among the warnings, too.
  std::vector<std::string> mistakes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::recordings
