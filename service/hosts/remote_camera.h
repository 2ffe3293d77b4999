// Cameras of other hosts as sources of frames, like those of this one.
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
  std::string host;             // as the camera host calls itself
  std::string camera_there;     // as the camera host calls it
  int width = 0, height = 0;    // > 0, pixels; the rig's: frames of another size are corrupted
  capture::FrameTiming timing;  // the rig's
  // Its frames say which pixels match the colours that LiveCamera::look_for() told, and have no pixels but with every
  // so many seconds' picture (0: none). Until it was told some, none come.
  bool are_matches = false;
  double picture_every_s = 1;
};

// One place on the bus for all cameras of other hosts. Frames of a host whose clock is not known yet are not handed
// out. A host that is silent for a second is a set of cameras that are absent, and come back by themselves; frames that
// come faster than they are taken push out older ones, counted as dropped. Stamps are turned to this host's clock,
// smoothed (camera_clock.h) and taken the latency out, as those of a camera of this host.
//
// The sources and their functions share what is behind it, and may outlive this object. thread-safe.
class RemoteCameras {
 public:
  // throws as DdsParticipant does; std::invalid_argument: a name is no is_host_name().
  RemoteCameras(const idl::ParticipantOptions& transport, std::vector<RemoteCameraOptions> cameras);

  // In the order of the options; once. Cameras of matches share sources, as many as the machine has cores: each of them
  // is with the first camera whose frames it gives, and the others have none.
  std::vector<capture::LiveCamera> live() const;

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace huetrack::hosts
