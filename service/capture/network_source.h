// A camera that is reached over the network by an address: rtsp://, http:// with motion JPEG, or what else FFmpeg can
// open.
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "capture/v4l2_source.h"

namespace huetrack::capture {

// Whether a camera's device is an address, like rtsp://host/stream, and no file.
bool is_network_address(std::string_view device);

struct NetworkSourceOptions {
  int camera = 0;             // >= 0; Frame::camera
  std::string name{};         // the camera's name in the rig, for messages
  std::string address{};      // scheme://...; rtsp, rtsps, http, https, tcp, udp or rtp
  int width = 0, height = 0;  // > 0, pixels; the rig's: a stream of another size is refused
  FrameTiming timing{};
  std::chrono::milliseconds retry{1000};      // > 0; between two attempts to reach it
  std::chrono::milliseconds patience{5000};   // > 0; without an answer or a picture for so long it counts as lost
  std::vector<std::string> problems() const;  // empty when valid; one sentence per violated constraint
};

// thread-compatible, one thread calls next(); health() and take_events() are thread-safe.
//
// Such a camera says when a picture was taken by no clock of ours. A frame's stamp is when its bytes had come, smoothed
// (camera_clock.h), less the latency: network and encoder are in it, tenths of a second that only a calibration can
// tell (huetrack-calibrate time). While the rig knows no latency, health() warns of that. RTP's own clock and RTCP's
// reports, which would say better, are not read.
//
// Motion JPEG is decoded as a webcam's is, and carries its own bytes in Frame::encoded. A picture that does not decode
// is handed out as corrupted. sequence counts pictures; what the network lost before they were whole is not known.
class NetworkSource final : public FrameSource {
 public:
  // Opens nothing yet. throws std::invalid_argument: options.problems().
  explicit NetworkSource(NetworkSourceOptions options);
  ~NetworkSource() override;

  // Blocks until the next frame, and tries again for as long as the camera is not there. nullopt only after a stop,
  // within milliseconds, but while a host's name is looked up. Never throws.
  std::optional<Frame> next(std::stop_token stop) override;

  CameraHealth health() const;
  std::vector<CameraEvent> take_events();  // since the last call

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::capture
