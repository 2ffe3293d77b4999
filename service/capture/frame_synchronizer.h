// Frames to sets: a pure state machine, no thread, no clock, no device.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "capture/frame.h"

namespace huetrack {

struct FrameSynchronizerOptions {
  int camera_count = 1;                    // >= 1
  // A set spans at most this long, first to last capture time. Free-running cameras of one rate: half a frame period puts
  // every frame into a set. Frames keep their own capture times inside the set.
  Duration tolerance = duration_of(0.017); // > 0
  std::vector<std::string> problems() const;
};

struct FrameSynchronizerCounters {
  std::uint64_t sets = 0;              // handed out
  std::uint64_t incomplete_sets = 0;   // of them, without every camera
  std::uint64_t late_frames = 0;       // older than a set already handed out: dropped
  std::uint64_t duplicate_frames = 0;  // a second frame of one camera for one set: the older is kept, this one dropped
  std::uint64_t corrupted_frames = 0;  // status not ok: not used
  std::uint64_t clock_jumps = 0;       // a camera's clock went back by more than a second: resynchronised
};

// Hands out a set as soon as it is complete, or as soon as newer frames prove that it never will be, in time order; one
// push can prove several sets at once. A camera that has stopped delivering is not waited for longer than until every
// other live camera has moved past the set.
// thread-compatible.
class FrameSynchronizer {
 public:
  explicit FrameSynchronizer(FrameSynchronizerOptions options);   // throws std::invalid_argument

  std::vector<FrameSet> push(Frame frame);
  std::optional<FrameSet> flush();                                // at the end of the stream: what is still open
  const FrameSynchronizerCounters& counters() const { return counters_; }

 private:
  // (the state that the implementation needs)
  FrameSynchronizerOptions options_;
  FrameSynchronizerCounters counters_;
};

}  // namespace huetrack
