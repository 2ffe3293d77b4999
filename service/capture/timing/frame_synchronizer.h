// Frames to sets: a pure state machine, no thread, no clock, no device.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/frames/frame.h"

namespace huetrack::capture {

struct FrameSynchronizerOptions {
  int camera_count = 1;    // >= 1
  int cameras_in_use = 0;  // 1..camera_count: a set of so many is complete; 0: all
  // A set spans at most this long, first to last capture time. Free-running cameras of one rate: half a frame period
  // puts every frame into a set (see suggested_tolerance). Frames keep their own capture times inside the set.
  Duration tolerance = duration_of(0.017);  // > 0
  // The frames of all cameras come merged by capture time, as from a recording: then nothing is late.
  bool ascending_input = false;
  std::vector<std::string> problems() const;
};

// The tolerance for cameras with these frame periods (0: unknown, left out). Free-running cameras of one period T, with
// phases as they happen to be, leave a gap of at least T/N somewhere on the circle of phases; all N frames lie in the
// other (1 - 1/N) T. So a set may span that much of the fastest period, and 5 % more for jitter: 0.55 T for two
// cameras, where it also means that nearest neighbours pair up. Never over 0.8 T: near T, a camera that loses one frame
// would be paired one period late from then on. 17 ms when no period is known.
Duration suggested_tolerance(std::span<const Duration> frame_periods);

// Every frame pushed ends in a set or in one of these.
struct FrameSynchronizerCounters {
  std::uint64_t sets = 0;              // handed out
  std::uint64_t incomplete_sets = 0;   // of them, without every camera
  std::uint64_t late_frames = 0;       // not newer than a set already handed out: dropped
  std::uint64_t early_frames = 0;      // over a second ahead of the other cameras, which did not follow: dropped
  std::uint64_t duplicate_frames = 0;  // a second frame of one camera with the same capture time: the first is kept
  std::uint64_t corrupted_frames = 0;  // status not ok: not used
  std::uint64_t clock_jumps = 0;       // the clock went back by more than a second: resynchronised, and the sets' times
                                       // restart from there
};

// Hands out a set as soon as it is complete, or as soon as newer frames prove that it never will be, in time order; one
// push can prove several sets at once. What the set waits for:
// - A camera is waited for until its own next frame is beyond the set (in order, so nothing older will come), or until
//   every other live camera has moved past the set. Frames of one camera that reach us later than the others' (a slower
//   transfer) are learned: then the others have to be further past the set by that much, up to 0.2 s.
// - A camera that has been silent for three of its frame periods (or a second, when its period is not known) has
//   stopped: nobody waits for it until it is back.
// - A corrupted or repeated frame is not used, but it shows that its camera has nothing else to give for that time.
// - A frame over a second (and three frame periods) off everyone's time, a driver's bad time stamp, is held back until
//   a second camera, or ten frames in a row, confirm it: then the clocks have changed, otherwise it is dropped and
//   counted.
// With ascending_input nothing of this is guessed: a set is handed out when a frame beyond its span has come, or when
// every camera has given a frame of the newest time. The sets then depend on the capture times alone.
// thread-compatible.
class FrameSynchronizer {
 public:
  explicit FrameSynchronizer(FrameSynchronizerOptions options);  // throws std::invalid_argument

  std::vector<FrameSet> push(Frame frame);
  // At the end of the stream: the next of what is still open; call until nullopt. Capture may go on afterwards.
  std::optional<FrameSet> flush();
  const FrameSynchronizerCounters& counters() const { return counters_; }

 private:
  struct CameraQueue {
    std::deque<Frame> waiting;        // not in a set yet, ascending capture times, corrupted ones included
    std::optional<Timestamp> newest;  // of the frames admitted
    Duration last_interval{0};        // between its last two frames; 0: not known yet
    Duration period{0};               // the shorter one of its last two intervals, so that a gap does not count
    Duration lag{0};  // how far behind the newest frame of all its frames reach us, a slowly falling maximum
  };

  Duration clock_jump() const;
  bool is_off_time(const Frame& frame) const;
  bool is_confirmed() const;
  void drop_off_time_frames();
  void admit(Frame frame);
  bool has_stopped(const CameraQueue& camera) const;
  bool is_waited_for(const CameraQueue& camera, Timestamp end_of_set) const;
  bool may_still_change(Timestamp end_of_set) const;
  std::optional<Timestamp> oldest_waiting() const;
  std::optional<FrameSet> take_set(Timestamp oldest);
  void hand_out_proven(std::vector<FrameSet>& out);

  FrameSynchronizerOptions options_;
  FrameSynchronizerCounters counters_;
  std::vector<CameraQueue> cameras_;
  std::optional<Timestamp> first_;         // admitted; of all cameras
  std::optional<Timestamp> newest_;        // admitted; of all cameras
  std::optional<Timestamp> closed_until_;  // the newest capture time in the sets handed out
  std::vector<Frame> off_time_;            // held back until confirmed
};

}  // namespace huetrack::capture
