// Live, recorded and simulated cameras are the same thing to everyone downstream.
#pragma once

#include <optional>
#include <stop_token>

#include "capture/frames/frame.h"

namespace huetrack::capture {

// A stream of frames in time order. thread-compatible: read by one thread.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  virtual std::optional<Frame> next(std::stop_token stop) = 0;  // blocks; nullopt = ended or stopped
  // No more frames of this camera will come, though of others they may. Called by the thread that calls next().
  virtual bool ended(int /*camera*/) const { return false; }
  // Of the time that was spent in next() so far, what was only waiting until a frame was due. The same thread.
  virtual Duration waited() const { return Duration{0}; }
};

}  // namespace huetrack::capture
