// A camera of a recording that is still being written, as if it were live: for who looks on while it is made.
#pragma once

#include <memory>

#include "capture/frames/frame_source.h"
#include "recordings/recording.h"

namespace huetrack::recordings {

// thread-compatible. Its frames have the container's times, to a millisecond from the recording's first frame, and the
// numbers in which they come; what their cameras told besides is read when the recording is whole.
class GrowingCamera final : public capture::FrameSource {
 public:
  // of: of a recording of ours (recording_writer.h). Opens nothing yet: its file need not be there. camera: of its
  // frames.
  GrowingCamera(RecordedCamera of, int camera);
  ~GrowingCamera() override;

  // Waits for the file, and at its end for more. nullopt after the stop, within some 50 ms, or where it cannot be read.
  std::optional<capture::Frame> next(std::stop_token stop) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::recordings
