// A camera that delivers frames now: of this host (V4l2Source, NetworkSource), of another one (hosts/remote_camera.h),
// or a test's.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "capture/frames/frame_source.h"
#include "capture/timing/host_clock.h"
#include "capture/v4l2/v4l2_device.h"

namespace huetrack::capture {

enum class CaptureState : std::uint8_t {
  waiting,  // opened or about to be; no frame yet
  delivering,
  stalled,  // open, but no undamaged frame for max(1 s, 10 periods): its stream is being restarted
  absent,   // not there (unplugged, another camera in its port, no permission, busy); retried again and again
};
std::string_view name(CaptureState state);

// A change of state, or a message for the user; each is reported once.
struct CameraEvent {
  Timestamp at;  // UNIX
  CaptureState state = CaptureState::waiting;
  bool is_problem = false;  // a warning; otherwise information
  std::string message;      // one line without the camera's name: "unplugged (No such device): waiting for its return"
};

// A snapshot.
struct CameraHealth {
  CaptureState state = CaptureState::waiting;
  std::string message;                    // of the last change of state
  std::string warning;                    // while it delivers, but many frames are damaged; empty: fine
  std::uint64_t frames = 0;               // delivered with an image
  std::uint64_t dropped = 0;              // gaps in the driver's sequence numbers
  std::uint64_t corrupted = 0;            // error-flagged, wrong length, or a JPEG that does not decode
  std::uint64_t copied = 0;               // because readers held too many buffers
  std::uint64_t restarts = 0;             // of a stalled stream
  std::uint64_t reconnects = 0;           // opened again after an absence
  std::optional<V4l2Identity> identity;   // of the camera that was last open
  std::optional<StreamFormat> stream;     // last negotiated
  StampKind stamp = StampKind::dequeued;  // of the last frame
  std::vector<ControlResult> controls;    // of the last time that they were applied
  std::optional<Timestamp> last_frame;    // its capture time
  std::optional<HostClock> clock;         // of a remote camera
  // When next() last made progress, with a frame or a planned wait: for a watchdog. At least every 0.5 s while next()
  // runs.
  std::chrono::steady_clock::time_point last_progress;
};

// A camera's controls while it delivers. thread-safe, and may outlive its source (then read() and set() throw). May
// take seconds when the camera does not answer.
class CameraControls {
 public:
  virtual ~CameraControls() = default;
  // throw CaptureError, one readable line: the camera is not there, or its controls cannot be accessed.
  virtual std::vector<Control> read() const = 0;
  // Applies them now, as V4l2Device::set_controls().
  virtual std::vector<ControlResult> set(std::span<const ControlSetting> settings) = 0;
  // Replaces the settings that are applied whenever the camera comes back.
  virtual void keep(std::vector<ControlSetting> settings) = 0;
};

// A camera's share of damaged frames, over about the last hundred.
class DamageWatch {
 public:
  void add(bool is_damaged);
  bool is_high() const { return is_high_; }  // above 10 %, until below 5 %
  double share() const { return share_; }    // 0 .. 1

 private:
  double share_ = 0;
  bool is_high_ = false;
};

struct LiveCamera {
  int camera = 0;                                         // in the rig
  std::unique_ptr<FrameSource> source;                    // nullptr: another camera's source delivers its frames, too
  std::function<CameraHealth()> health;                   // thread-safe while source lives
  std::function<std::vector<CameraEvent>()> take_events;  // thread-safe while source lives
  std::shared_ptr<CameraControls> controls = nullptr;     // nullptr: not accessible from here

  // The rest is for cameras with `send: matches`; nullptr for others. thread-safe, and may outlive source.
  // Sets the colours whose matches are sent from now on.
  std::function<void(std::span<const MatchedColor>)> look_for = nullptr;
  // Predicted outlines in this camera's frame of that number (Frame::sequence). After those of all cameras of a frame
  // set, send_outlines() sends what was collected for the camera's host; the next frames then include the pixels there.
  std::function<void(std::uint32_t, std::span<const ExpectedOutline>)> expect_outlines = nullptr;
  std::function<void()> send_outlines = nullptr;
};

}  // namespace huetrack::capture
