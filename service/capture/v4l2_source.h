// One live V4L2 camera as a source of frames. It recovers by itself from unplugging, stalls and errors.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "capture/live_camera.h"

namespace huetrack::capture {

struct V4l2SourceOptions {
  int camera = 0;                // >= 0; Frame::camera
  std::string name;              // the camera's name in the rig, for messages
  std::filesystem::path device;  // /dev/v4l/by-path/... (a port), by-id/... (a camera), or /dev/videoN (unstable)
  std::optional<CaptureFormat> format;   // nullopt: see StreamRequest::format
  int width = 0, height = 0;             // > 0, pixels; the rig's
  double fps = 0;                        // >= 0, <= 10000; 0: the driver's choice
  std::vector<ControlSetting> controls;  // applied at start, and again after a replug
  bool restore_controls = false;         // restore the camera's own values at the end
  FrameTiming timing;
  int buffers = 8;                       // 4 .. 32; readers may hold all but three of them, then frames are copied
  std::chrono::milliseconds retry{700};  // > 0; between two attempts to open an absent camera
  // > 0; how long the constructor waits for a camera that does not answer. next() waits on, and reports it.
  std::chrono::milliseconds first_patience{std::chrono::minutes(1)};
  // Treats a camera that cannot do what is asked as absent, instead of an error of the constructor: the right one may
  // be plugged in later.
  bool may_be_wrong = false;
  // Decode JPEGs. False, for frames that are only forwarded: they carry their bytes (Frame::encoded), and an image with
  // a size but no pixels; the receiver finds out whether they decode.
  bool decodes = true;
  std::vector<std::string> problems() const;  // empty when valid; one sentence per violated constraint
  // Allowed but perhaps a mistake: a /dev/videoN, which is not a stable name.
  std::vector<std::string> warnings() const;
};

// thread-compatible: one thread calls next(); health() and take_events() are thread-safe.
//
// Capture times are UNIX time (capture_clock.h): the driver's stamps, smoothed (camera_clock.h), minus the latency. A
// damaged frame's stamp is not smoothed, and does not affect others. sequence starts at 0 and follows the driver's, so
// a gap is a drop; after a restart or a replug it continues without a gap. MJPEG is decoded to planar YUV and carries
// its own bytes in Frame::encoded. A frame that the driver flagged, of a wrong length, or that does not decode is
// delivered as corrupted, without an image; a camera that delivers only such frames is stalled.
//
// Opening, restarting and closing may take seconds when a camera has locked up (uvcvideo waits 5 s for each answer).
// They run in a thread of their own, for which next() waits until its stop, and the destructor at most 0.5 s. A thread
// that still hangs then is abandoned: see abandoned_cameras().
class V4l2Source final : public FrameSource {
 public:
  // Opens the camera and starts it. A camera that is not there, busy, not permitted, or does not answer within
  // first_patience or before a stop is no error: next() waits for it. throws CaptureError when it is there but cannot
  // do what is asked, such as a size (std::errc::invalid_argument; see may_be_wrong); std::invalid_argument:
  // options.problems().
  explicit V4l2Source(V4l2SourceOptions options, const std::stop_token& stop = {});
  ~V4l2Source() override;  // stops; restores the controls if requested

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

// Cameras whose driver still held one of our threads when their source was destroyed. If there are any, end the process
// with _Exit: such a thread may return at any time. thread-safe.
std::vector<std::string> abandoned_cameras();

}  // namespace huetrack::capture
