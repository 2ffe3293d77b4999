// A camera of a recording that is still being written, as a live source.
#pragma once

#include <memory>

#include "capture/frames/frame_source.h"
#include "recordings/recording.h"

namespace huetrack::recordings {

// thread-compatible. Frames have the container's times, milliseconds since the recording's first frame, and are
// numbered as they come; the time-stamp file is not used.
class GrowingCamera final : public capture::FrameSource {
 public:
  // of: from a recording of ours (recording_writer.h). Opens nothing yet: the file need not exist. camera:
  // Frame::camera.
  GrowingCamera(RecordedCamera of, int camera);
  ~GrowingCamera() override;

  // Waits for the file, and at its end for more. nullopt after the stop, within some 50 ms, or when it cannot be read.
  std::optional<capture::Frame> next(std::stop_token stop) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::recordings
