// One V4L2 camera and its stream. Single-planar and multi-planar drivers behave the same from here. Errors at start are
// thrown as CaptureError, one line that names the device and gives advice:
//   /dev/video2: No space left on device: that is USB bandwidth, not the disk: ...
// While streaming they are values.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "capture/frames/capture_error.h"
#include "capture/v4l2/camera_control.h"
#include "capture/v4l2/camera_identity.h"
#include "capture/v4l2/capture_format.h"
#include "capture/v4l2/stream_buffers.h"

namespace huetrack::capture {

enum class DequeueOutcome : std::uint8_t {
  frame,
  timeout,    // no frame in time
  stopped,    // wake() was called
  unplugged,  // the device is gone: open it again
  failed,     // the driver gave up (EIO, a vanished queue): restart the stream, or open it again
};
struct DequeueResult {
  DequeueOutcome outcome = DequeueOutcome::timeout;
  Dequeued frame{};       // for frame
  std::string message{};  // for unplugged and failed: one readable line
};

// thread-compatible: one thread; except wake() and letting go of frames, which any thread may do at any time.
class V4l2Device {
 public:
  // path: /dev/v4l/by-path/..., /dev/v4l/by-id/..., /dev/videoN. throws CaptureError: not there, no permission, busy,
  // not a camera (a metadata node, an output).
  explicit V4l2Device(const std::filesystem::path& path);
  ~V4l2Device();  // stops the stream; held buffers stay readable until they are let go
  V4l2Device(V4l2Device&&) noexcept;
  V4l2Device& operator=(V4l2Device&&) noexcept;

  const V4l2Identity& identity() const;
  std::vector<OfferedFormat> formats() const;  // empty: the driver does not enumerate

  std::vector<Control> controls() const;
  // Sets automatic controls first, so that manual values stick, and reads all back at the end. A manual value switches
  // off the automatic control that overrides it, unless `settings` contains that one (is_implied). One result per
  // setting, in that order, the implied ones at the end. Does not throw. Stops at a camera that does not answer
  // (is_unanswered).
  std::vector<ControlResult> set_controls(std::span<const ControlSetting> settings);
  // In the given order, nothing implied: for previous_controls(). Does not throw.
  std::vector<ControlResult> set_controls_plainly(std::span<const ControlSetting> settings);
  // Values from before the first set_controls() that changed them, in the order in which they can be set back.
  const std::vector<ControlSetting>& previous_controls() const;

  // Reserves format, size, rate and buffers: from here on no other program can stream, and the controls are ours. These
  // three throw CaptureError.
  StreamFormat claim(const StreamRequest& request);
  void stream();                                     // STREAMON, after claim()
  StreamFormat start(const StreamRequest& request);  // both
  // STREAMOFF and ON again with the buffers that readers do not hold: for a driver that stopped delivering. False: it
  // does not start any more, and message contains the reason.
  bool restart(std::string& message);
  void stop();  // idempotent; after claim() too

  // The next frame. Does not throw.
  DequeueResult dequeue(std::chrono::milliseconds patience);
  void wake();  // thread-safe: ends the current or next dequeue() with `stopped`
  // Copy the frame and let go of it: fewer than three buffers are left to the driver, or it is v4l2loopback, whose
  // player overwrites buffers that readers hold.
  bool is_short_of_buffers() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Advice on this errno of a camera, as in "that is USB bandwidth, not the disk: ..."; empty when there is none.
std::string advice_for(int error_number);

}  // namespace huetrack::capture
