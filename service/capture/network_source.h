// A network camera: rtsp://, http:// with motion JPEG, or any other address that FFmpeg can open.
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "capture/live_camera.h"

namespace huetrack::capture {

// True for an address such as rtsp://host/stream.
bool is_network_address(std::string_view device);

struct NetworkSourceOptions {
  int camera = 0;             // >= 0; Frame::camera
  std::string name{};         // the camera's name in the rig, for messages
  std::string address{};      // scheme://...; rtsp, rtsps, http, https, tcp, udp or rtp
  int width = 0, height = 0;  // > 0, pixels; a stream of another size is refused
  FrameTiming timing{};
  std::chrono::milliseconds retry{1000};      // > 0; between two attempts to connect
  std::chrono::milliseconds patience{5000};   // > 0; longest time without an answer or a picture
  std::vector<std::string> problems() const;  // empty when valid; one sentence per violated constraint
};

// thread-compatible: one thread calls next(); health() and take_events() are thread-safe.
//
// Such a camera has no clock of ours: a frame's stamp is the arrival of its bytes, smoothed (camera_clock.h), minus the
// latency. That latency includes network and encoder, tenths of a second, and only a calibration can measure it
// (huetrack-calibrate time); while the rig has none, health() warns. RTP time stamps and RTCP reports are not used.
//
// Motion JPEG is decoded as a webcam's, and carries its own bytes in Frame::encoded. A picture that does not decode is
// delivered as corrupted. sequence counts pictures; losses in the network are not known.
class NetworkSource final : public FrameSource {
 public:
  // Opens nothing yet. throws std::invalid_argument: options.problems().
  explicit NetworkSource(NetworkSourceOptions options);
  ~NetworkSource() override;

  // Blocks until the next frame, reconnecting as needed. nullopt only after a stop, within milliseconds except during a
  // name lookup. Never throws.
  std::optional<Frame> next(std::stop_token stop) override;

  CameraHealth health() const;
  std::vector<CameraEvent> take_events();  // since the last call

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::capture
