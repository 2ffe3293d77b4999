// One live camera as a source of frames: it comes back by itself from whatever happens to it.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
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

struct V4l2SourceOptions {
  int camera = 0;                // >= 0; Frame::camera
  std::string name;              // the camera's name in the rig, for messages
  std::filesystem::path device;  // /dev/v4l/by-path/... (a port), by-id/... (a camera), or /dev/videoN (unstable)
  std::optional<CaptureFormat> format;   // nullopt: see StreamRequest::format
  int width = 0, height = 0;             // > 0, pixels; the rig's
  double fps = 0;                        // >= 0, <= 10000; 0: the driver's choice
  std::vector<ControlSetting> controls;  // applied at start, and again after a replug
  bool restore_controls = false;         // put the camera's own values back at the end
  FrameTiming timing;
  int buffers = 8;                       // 4 .. 32; readers may hold all but three of them, then frames are copied
  std::chrono::milliseconds retry{700};  // > 0; between two attempts to open an absent camera
  // > 0; how long the constructor waits for a camera that does not answer. next() waits on, and says so.
  std::chrono::milliseconds first_patience{std::chrono::minutes(1)};
  // A camera that is there but cannot do what is asked is one that is absent, instead of an error of the constructor:
  // the right one may be plugged in later.
  bool may_be_wrong = false;
  // JPEGs are decoded. False, for frames that only travel on: they carry their bytes (Frame::encoded), and an image
  // that has a size but no pixels; whether they decode is for who receives them to see.
  bool decodes = true;
  std::vector<std::string> problems() const;  // empty when valid; one sentence per violated constraint
  // Allowed but perhaps not meant: a /dev/videoN, which is not stable.
  std::vector<std::string> warnings() const;
};

enum class CaptureState : std::uint8_t {
  waiting,  // opened or just about to be; no frame yet
  delivering,
  stalled,  // open, but no sound frame for max(1 s, 10 periods): its stream is being restarted
  absent,   // not there (unplugged, another camera in its port, no permission, busy): tried again and again
};
std::string_view name(CaptureState state);

// A change of state or something the user should read, each once.
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
  std::string warning;                    // while it delivers, but many frames are damaged; empty: all is well
  std::uint64_t frames = 0;               // handed out with an image
  std::uint64_t dropped = 0;              // gaps in the driver's sequence numbers
  std::uint64_t corrupted = 0;            // error-flagged, wrong length, or a JPEG that does not decode
  std::uint64_t copied = 0;               // because readers held too many buffers
  std::uint64_t restarts = 0;             // of a stalled stream
  std::uint64_t reconnects = 0;           // opened again after an absence
  std::optional<V4l2Identity> identity;   // of the camera that was last open
  std::optional<StreamFormat> stream;     // what it agreed to, last
  StampKind stamp = StampKind::dequeued;  // of the last frame
  std::vector<ControlResult> controls;    // of the last time that they were applied
  std::optional<Timestamp> last_frame;    // its capture time
  std::optional<HostClock> clock;         // of a camera of another host
  // When next() last came round, with a frame or deliberately waiting: for a watchdog. At least every 0.5 s while
  // next() is being called.
  std::chrono::steady_clock::time_point last_progress;
};

// The controls of a camera while it delivers, for who sets it up. thread-safe, and valid when its source is gone: then
// it says so. May take seconds where a camera does not answer.
class CameraControls {
 public:
  virtual ~CameraControls() = default;
  // throw CaptureError of one readable line: the camera is not there, or does not let itself be asked.
  virtual std::vector<Control> read() const = 0;
  // At once, as V4l2Device::set_controls().
  virtual std::vector<ControlResult> set(std::span<const ControlSetting> settings) = 0;
  // What is applied from now on whenever the camera comes back, instead of what it was until now.
  virtual void keep(std::vector<ControlSetting> settings) = 0;
};

// What share of a camera's frames is damaged, over about the last hundred.
class DamageWatch {
 public:
  void add(bool is_damaged);
  bool is_high() const { return is_high_; }  // above 10 %, and then until it is below 5 %
  double share() const { return share_; }    // 0 .. 1
 private:
  double share_ = 0;
  bool is_high_ = false;
};

// thread-compatible, one thread calls next(); health() and take_events() are thread-safe.
//
// Frames: capture times are UNIX time (capture_clock.h): the driver's own stamps, smoothed (camera_clock.h), less the
// latency. A damaged frame's stamp is not smoothed, and counts for no other's. sequence
// starts at 0 and follows the driver's, so a gap is a drop; after a restart or a replug it goes on without a gap. MJPEG
// is decoded to planar YUV and carries its own bytes in Frame::encoded. A frame that the driver flagged, of a wrong
// length, or that does not decode is handed out as corrupted, without an image; a camera that gives no others is
// stalled.
//
// Whatever asks the camera itself and may take seconds when it has locked up (opening, restarting, closing: uvcvideo
// waits 5 s for each answer) runs in a thread of its own, while next() and the destructor wait for it: next() until it
// is stopped, the destructor for 0.5 s at the most. A thread that hangs on then is left alone: see abandoned_cameras().
class V4l2Source final : public FrameSource {
 public:
  // Opens the camera and starts it. A camera that is not there, busy, or not permitted is no error, and neither is one
  // that does not answer within first_patience or before a stop: next() waits for it. throws CaptureError when it is
  // there but cannot do what is asked (std::errc::invalid_argument; see may_be_wrong), such as a size that it has not;
  // std::invalid_argument: options.problems().
  explicit V4l2Source(V4l2SourceOptions options, const std::stop_token& stop = {});
  ~V4l2Source() override;  // stops; restores the controls when asked

  // Blocks until the next frame, through unplugging, stalls and returns; nullopt only after a stop, within
  // milliseconds. Never throws.
  std::optional<Frame> next(std::stop_token stop) override;

  CameraHealth health() const;
  std::vector<CameraEvent> take_events();  // since the last call
  std::shared_ptr<CameraControls> controls() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The names of cameras whose driver still held a thread of ours when their source went: end the process with _Exit, as
// that thread may come back at any time. thread-safe.
std::vector<std::string> abandoned_cameras();

}  // namespace huetrack::capture
