// Remote cameras (of other hosts) as sources of frames, like local ones.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "capture/live_camera.h"
#include "idl/participant_options.h"

namespace huetrack::hosts {

struct RemoteCameraOptions {
  int camera = 0;               // in the rig: Frame::camera
  std::string name;             // in the rig, for messages
  std::string host;             // the camera host's name
  std::string camera_there;     // the camera's name on that host
  int width = 0, height = 0;    // > 0, pixels; the rig's: frames of another size are corrupted
  capture::FrameTiming timing;  // the rig's
  // Frames carry matches (Frame::matches) of the colours set by LiveCamera::look_for(), and pixels only with the
  // picture every so many seconds (0: none). Before look_for() no frames come.
  bool are_matches = false;
  double picture_every_s = 1;
};

// Imports all remote cameras with one DDS participant. Frames are held back until their host's clock offset is known.
// If a host is silent for a second, its cameras are absent, and recover by themselves. When frames arrive faster than
// they are read, the oldest are dropped and counted. Stamps are converted to this host's clock, smoothed
// (camera_clock.h) and corrected by the latency, as those of a local camera.
//
// The sources and their functions share the implementation, and may outlive this object. thread-safe.
class RemoteCameras {
 public:
  // throws as DdsParticipant does; std::invalid_argument: a name is not is_host_name().
  RemoteCameras(const idl::ParticipantOptions& transport, std::vector<RemoteCameraOptions> cameras);

  // In the order of the options; call once. Cameras with matches share sources, one per core: each source belongs to
  // the first of its cameras, and the others have none.
  std::vector<capture::LiveCamera> live() const;

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace huetrack::hosts
