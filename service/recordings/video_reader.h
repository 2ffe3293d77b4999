// Reads one camera's pictures from a video file or a series of image files, numbered by their position in the stream.
// Private to this module.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "capture/frames/frame.h"
#include "recordings/picture_stream.h"
#include "recordings/recording.h"

namespace huetrack::recordings {

// The frames of the stream that a recording plays.
class FrameSelection {
 public:
  explicit FrameSelection(const RecordedCamera& camera) : camera_(camera) {}  // camera must outlive it
  bool contains(std::int64_t index) const;
  std::optional<std::int64_t> last() const;          // known if frames are listed
  std::int64_t count_below(std::int64_t end) const;  // selected ones among 0 .. end - 1

 private:
  const RecordedCamera& camera_;
};

// thread-compatible.
class VideoReader final : public PictureStream {
 public:
  using Shown = recordings::Shown;

  // camera and warnings must outlive the reader. Warnings are one line each. throws ConfigError that names the file.
  // growing: the file is still being written: wait for more at its end, until this stop. nullopt: it is complete.
  VideoReader(const RecordedCamera& camera, int threads, std::vector<std::string>& warnings,
              std::optional<std::stop_token> growing = std::nullopt, bool keeps_jpeg = false);
  ~VideoReader() override;
  VideoReader(const VideoReader&) = delete;
  VideoReader& operator=(const VideoReader&) = delete;

  std::optional<Shown> next() override;
  std::int64_t position() const override;
  std::optional<std::int64_t> frame_count() const override;
  capture::Duration frame_period() const override;  // average
  std::optional<capture::Duration> clock_start() const override;
  bool is_turned() const override;
  std::optional<std::string> wrong_times() const override;
  std::optional<int> unexplained_largest() const override;
  std::span<const ImageFile> series() const override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::recordings
