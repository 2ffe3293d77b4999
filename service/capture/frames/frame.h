// A frame carries its time, its number and its health.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "capture/frames/matches.h"
#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

// Capture times, nanoseconds. Live: UNIX time. Replay: the recording's own clock (its zero is the recording's).
using Timestamp = std::chrono::time_point<std::chrono::system_clock, std::chrono::nanoseconds>;
using Duration = std::chrono::nanoseconds;

inline double seconds(Duration d) {
  return std::chrono::duration<double>(d).count();
}
inline double seconds(Timestamp t) {
  return seconds(t.time_since_epoch());
}
inline Duration duration_of(double s) {
  return std::chrono::round<Duration>(std::chrono::duration<double>(s));
}

enum class FrameStatus : std::uint8_t {
  ok,
  corrupted,  // the driver flagged it (V4L2_BUF_FLAG_ERROR), or it does not decode: counted, never used
  repeated,   // it shows the camera's picture before it once more (repeat_watch.h): counted, never used
};

// What is known of when a camera's rows are exposed (calib::CameraTiming); 0 where it is not.
struct FrameTiming {
  Duration latency{0};  // from the middle row's mid-exposure to the driver's time stamp
  Duration readout{0};  // from the first row's mid-exposure to the last's; < 0: it reads upwards
  bool operator==(const FrameTiming&) const = default;
};

// Whose clock stamped a frame, and how well that clock is known next to ours. The error is one for all cameras that it
// stamps, and wanders slowly.
struct StampClock {
  std::uint16_t of = 0;  // 0: this host's own; other hosts' are numbered from 1
  Duration sigma{0};     // standard deviation of the clock's offset to ours as it was taken off
  bool operator==(const StampClock&) const = default;
};

struct Frame {
  int camera = 0;              // index into CameraRig::cameras
  std::uint32_t sequence = 0;  // 0 at stream start; a gap is a drop
  Timestamp captured_at;       // mid-exposure of its middle row, as far as that is known; never when we woke up
  Timestamp stamped_at{};  // the driver's own time stamp; captured_at is that smoothed (camera_clock.h), less latency
  Duration latency{0};     // of the camera, as far as known; captured_at + latency is the smoothed stamp
  Duration readout{0};     // from its first row's mid-exposure to its last row's, as far as known
  StampClock clock = {};   // of stamped_at
  FrameStatus status = FrameStatus::ok;
  Image pixels;
  // Which of its pixels match, in place of them: `pixels` then has their format, range and size, and no planes.
  // nullptr: the pixels are there.
  std::shared_ptr<const Matches> matches = {};
  // The camera's own bytes of this image, when it came compressed (MJPEG), or of its matches: for a recorder, which
  // must not encode anew.
  std::shared_ptr<const std::vector<std::uint8_t>> encoded = {};
  // Which number among all cameras' frames it had when it entered the FrameSynchronizer, from 1; 0: not numbered. The
  // frames of a set depend on the order of arrival; a recording keeps it, and a replay repeats it.
  std::uint64_t arrival = 0;
  // Which frame of its recorded stream it is, of a replay that may begin later or leave frames out (first_frame,
  // every), where `sequence` counts what is played. nullopt: `sequence` is the camera's own count.
  std::optional<std::int64_t> stream_index = {};

  // Mid-exposure of a row, 0 the topmost one; fractions are between rows.
  Timestamp row_time(double row) const {
    const double below_middle = pixels.height > 1 ? row / (pixels.height - 1) - 0.5 : 0.0;
    return captured_at + Duration(static_cast<Duration::rep>(below_middle * static_cast<double>(readout.count())));
  }
};

// What people are shown of it: its pixels, or the latest picture that came with its camera's matches. nullptr: there is
// none. Valid while the frame is.
inline const Image* picture_of(const Frame& frame) {
  const Image& image = frame.matches ? frame.matches->picture : frame.pixels;
  return has_pixels(image) ? &image : nullptr;
}
// picture_of(), but only of this very frame: for what watches colours and rooms. With matches now and then.
inline const Image* own_picture_of(const Frame& frame) {
  return frame.matches && !frame.matches->has_own_picture ? nullptr : picture_of(frame);
}

// In the place of what matches a picture that came with it, as picture_of() or own_picture_of() say it, for who needs
// pixels. False: there is none (nullptr), and the frame stays as it is.
inline bool take_picture(Frame& frame, const Image* picture) {
  if (!frame.matches) return true;
  if (picture == nullptr) return false;
  frame.pixels = Image(*picture);
  frame.matches = nullptr;
  frame.encoded = nullptr;
  return true;
}

// What the cameras saw at (nearly) one time. A camera that gave no usable frame is absent, not black.
struct FrameSet {
  std::uint64_t number = 0;                  // counts the sets that were handed out, from 0
  Timestamp at;                              // capture time of the newest frame in it
  std::vector<std::optional<Frame>> frames;  // one slot per camera of the rig
};

}  // namespace huetrack::capture
