// Groups frames into frame sets: a pure state machine without threads, clocks or devices.
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
  int cameras_in_use = 0;  // 1..camera_count: number of frames in a complete set; 0: all cameras
  // > 0; a set's longest span, first to last capture time (see suggested_tolerance). Frames keep their capture times.
  Duration tolerance = duration_of(0.017);
  bool ascending_input = false;  // frames of all cameras come merged by capture time, as from a recording: none is late
  std::vector<std::string> problems() const;
};

// The tolerance for cameras with these frame periods (0: unknown, ignored). The phases of N free-running cameras of
// period T leave a gap of at least T/N, so all N frames lie within (1 - 1/N) T. The result is that share of the fastest
// period plus 5 % for jitter, which for two cameras (0.55 T) pairs nearest neighbours. At most 0.8 T: near T, a camera
// that loses one frame would be paired one period late from then on. 17 ms when no period is known.
Duration suggested_tolerance(std::span<const Duration> frame_periods);

// Every pushed frame ends in a set or in one of these.
struct FrameSynchronizerCounters {
  std::uint64_t sets = 0;
  std::uint64_t incomplete_sets = 0;   // of `sets`, those without every camera
  std::uint64_t late_frames = 0;       // not newer than an output set: dropped
  std::uint64_t early_frames = 0;      // over a second ahead of the other cameras, which did not follow: dropped
  std::uint64_t duplicate_frames = 0;  // same camera and capture time as another frame: the first is kept
  std::uint64_t corrupted_frames = 0;  // status not ok: not used
  std::uint64_t clock_jumps = 0;       // the clock went back by over a second: the sets' times restart from there
};

// Outputs a set, in time order, as soon as it is complete or newer frames prove that it never will be; one push can
// prove several sets. Rules:
// - A set waits for a camera until that camera's next frame is beyond the set, or until every other live camera has
//   moved past the set. If a camera's frames arrive later than the others' (a slower transfer), that lag is learnt, up
//   to 0.2 s: the others must then be past the set by that much.
// - A camera that has been silent for three of its frame periods (or a second, when its period is unknown) has stopped;
//   sets do not wait for it until it returns.
// - A corrupted or repeated frame is not used, but proves that its camera has no other frame for that time.
// - A frame over a second (and three frame periods) away from the newest time is held back until a second camera, or
//   ten frames in a row, confirm it: then the clocks have changed; otherwise it was a bad stamp and is dropped.
// With ascending_input a set is output when a frame beyond its span has come, or when every camera has a frame of the
// newest time: the sets depend on the capture times alone. thread-compatible.
class FrameSynchronizer {
 public:
  explicit FrameSynchronizer(FrameSynchronizerOptions options);  // throws std::invalid_argument

  std::vector<FrameSet> push(Frame frame);
  // At the end of the stream: the next set that is still open; call until nullopt. push() may follow.
  std::optional<FrameSet> flush();
  const FrameSynchronizerCounters& counters() const { return counters_; }

 private:
  struct CameraQueue {
    std::deque<Frame> waiting;        // not in a set yet, ascending capture times, corrupted ones included
    std::optional<Timestamp> newest;  // of the frames admitted
    Duration last_interval{0};        // between its last two frames; 0: not known yet
    Duration period{0};               // the shorter one of its last two intervals, so that a gap does not count
    Duration lag{0};  // its frames' lag behind the newest frame of all cameras: a slowly falling maximum
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
  void output_proven(std::vector<FrameSet>& out);

  FrameSynchronizerOptions options_;
  FrameSynchronizerCounters counters_;
  std::vector<CameraQueue> cameras_;
  std::optional<Timestamp> first_;         // admitted; of all cameras
  std::optional<Timestamp> newest_;        // admitted; of all cameras
  std::optional<Timestamp> closed_until_;  // the newest capture time in an output set
  std::vector<Frame> off_time_;            // held back until confirmed
};

}  // namespace huetrack::capture
