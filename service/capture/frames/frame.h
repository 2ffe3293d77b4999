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
  corrupted,  // flagged by the driver (V4L2_BUF_FLAG_ERROR), or not decodable: counted, never used
  repeated,   // shows the camera's previous picture again (repeat_watch.h): counted, never used
};

// When a camera's rows are exposed (calib::CameraTiming); 0 where unknown.
struct FrameTiming {
  Duration latency{0};  // from the middle row's mid-exposure to the driver's time stamp
  Duration readout{0};  // from the first row's mid-exposure to the last's; < 0: the sensor reads upwards
  bool operator==(const FrameTiming&) const = default;
};

// The clock that stamped a frame, and how well its offset to ours is known. The offset's error is common to all cameras
// that the clock stamps, and varies slowly.
struct StampClock {
  std::uint16_t of = 0;  // 0: this host's clock; those of other hosts are numbered from 1
  Duration sigma{0};     // 1 sigma of the offset that was subtracted
  bool operator==(const StampClock&) const = default;
};

struct Frame {
  int camera = 0;              // index into CameraRig::cameras
  std::uint32_t sequence = 0;  // 0 at stream start; a gap is a drop
  Timestamp captured_at;   // mid-exposure of the middle row, as far as known: smoothed stamp (camera_clock.h) - latency
  Timestamp stamped_at{};  // the driver's own time stamp
  Timestamp arrived_at{};  // live: UNIX time at which its last byte had arrived, before decoding; 0: not known
  Duration latency{0};     // FrameTiming::latency
  Duration readout{0};     // FrameTiming::readout
  StampClock clock = {};   // of stamped_at
  FrameStatus status = FrameStatus::ok;
  Image pixels;
  // Replaces the pixels of a camera with `send: matches`: `pixels` then has format, range and size, but no planes.
  // nullptr: the pixels are there.
  std::shared_ptr<const Matches> matches = {};
  // The camera's own bytes of a compressed image (MJPEG), or of the matches: a recorder must not encode again.
  std::shared_ptr<const std::vector<std::uint8_t>> encoded = {};
  // Its number, from 1, among all cameras' frames in order of arrival at the FrameSynchronizer; 0: not numbered. Frame
  // sets depend on that order, so recordings store it and replays repeat it.
  std::uint64_t arrival = 0;
  // Index in the recorded stream, in a replay that skips frames (first_frame, every) and whose `sequence` counts only
  // played frames. nullopt: `sequence` is the camera's own count.
  std::optional<std::int64_t> stream_index = {};

  // Mid-exposure of a row; row 0 is the topmost, fractions are between rows.
  Timestamp row_time(double row) const {
    const double below_middle = pixels.height > 1 ? row / (pixels.height - 1) - 0.5 : 0.0;
    return captured_at + Duration(static_cast<Duration::rep>(below_middle * static_cast<double>(readout.count())));
  }
};

// The picture to display: the frame's pixels, or the latest picture that came with the camera's matches. nullptr: none.
// Valid while the frame is.
inline const Image* picture_of(const Frame& frame) {
  const Image& image = frame.matches ? frame.matches->picture : frame.pixels;
  return has_pixels(image) ? &image : nullptr;
}
// picture_of(), but only if it belongs to this frame; with matches only some frames have one.
inline const Image* own_picture_of(const Frame& frame) {
  return frame.matches && !frame.matches->has_own_picture ? nullptr : picture_of(frame);
}

// Replaces a frame's matches by `picture` (from picture_of() or own_picture_of()). False: picture is nullptr, and the
// frame is unchanged.
inline bool take_picture(Frame& frame, const Image* picture) {
  if (!frame.matches) return true;
  if (picture == nullptr) return false;
  frame.pixels = Image(*picture);
  frame.matches = nullptr;
  frame.encoded = nullptr;
  return true;
}

// One frame per camera from (nearly) the same time. A camera without a usable frame is absent, not black.
struct FrameSet {
  std::uint64_t number = 0;                  // from 0, in order of output
  Timestamp at;                              // capture time of the newest frame in it
  std::vector<std::optional<Frame>> frames;  // one slot per camera of the rig
};

}  // namespace huetrack::capture
