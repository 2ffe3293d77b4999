// One camera's pictures out of a video file or a series of image files, numbered as they lie in the stream. Private to
// this module.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "capture/frames/frame.h"
#include "recordings/recording.h"

namespace huetrack::recordings {

// Which frames of the stream a recording plays.
class FrameSelection {
 public:
  explicit FrameSelection(const RecordedCamera& camera) : camera_(camera) {}  // camera must outlive it
  bool contains(std::int64_t index) const;
  std::optional<std::int64_t> last() const;          // known when they are listed
  std::int64_t count_below(std::int64_t end) const;  // selected ones among 0 .. end - 1

 private:
  const RecordedCamera& camera_;
};

// thread-compatible.
class VideoReader {
 public:
  struct Shown {
    std::int64_t index = 0;                   // in the stream; a picture that is lost still takes its number
    std::optional<capture::Timestamp> stamp;  // the container's own presentation time, if it has one
    capture::Image image;                     // of width 0: it does not decode
    std::shared_ptr<const std::vector<std::uint8_t>> jpeg = {};  // as it lies in the file, if that is one and is wanted
    std::shared_ptr<const capture::Matches> matches = {};  // of a file of matches (matches_reader.h); no planes then
  };

  // camera and warnings must outlive the reader. Warnings are one line each. throws ConfigError that names the file
  // growing: the file is still being written: at its end more is waited for, until the stop. nullopt: it is whole.
  VideoReader(const RecordedCamera& camera, int threads, std::vector<std::string>& warnings,
              std::optional<std::stop_token> growing = std::nullopt, bool keeps_jpeg = false);
  ~VideoReader();
  VideoReader(const VideoReader&) = delete;
  VideoReader& operator=(const VideoReader&) = delete;

  std::optional<Shown> next();  // the next selected one; nullopt at the end. Never throws.

  std::optional<std::int64_t> frame_count() const;  // of the whole stream, as the file declares it: may be wrong
  capture::Duration frame_period() const;           // average, as the file declares it; 0 when unknown

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::recordings
