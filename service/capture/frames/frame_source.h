// The common interface of live, recorded and simulated cameras.
#pragma once

#include <cstdint>
#include <optional>
#include <stop_token>

#include "capture/frames/frame.h"

namespace huetrack::capture {

// A stream of frames in time order. thread-compatible: read by one thread, which also calls the other functions.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  virtual std::optional<Frame> next(std::stop_token stop) = 0;  // blocks; nullopt: ended or stopped
  virtual bool ended(int /*camera*/) const { return false; }    // this camera has no more frames; others may have
  // Time spent in next() so far only waiting until a frame was due.
  virtual Duration waited() const { return Duration{0}; }
  // How often the stream has jumped to another moment, up to the last frame returned: its capture times rise, but what
  // it shows does not continue the frames before.
  virtual std::uint64_t jumps() const { return 0; }
};

}  // namespace huetrack::capture
