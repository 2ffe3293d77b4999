// Exports a host's cameras to trackers on other hosts over DDS (`huetrackd capture`): frames as the camera's own bytes,
// camera states, and the host's clock.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "capture/frames/light_watch.h"
#include "capture/live_camera.h"
#include "idl/participant_options.h"

namespace huetrack::hosts {

struct CameraHostOptions {
  std::string host;                   // the name that trackers use
  std::vector<std::string> cameras;   // their names, in the order of the LiveCameras
  std::string program_version;        // published
  idl::ParticipantOptions transport;  // domain, interfaces, profiles
  // Describes light problems in sentences for users; empty: none. Published as a warning of the camera. Used only for
  // cameras whose matches are sent, because trackers have no pictures of them. Called by the cameras' threads. Not set:
  // light is not reported.
  std::function<std::string(const capture::LightFindings&)> describe_light = nullptr;
};

// Names of hosts and remote cameras are parts of topic names: one or more letters, digits, '_', '-' and '.'.
bool is_host_name(std::string_view name);
// throws std::invalid_argument: a name is not a valid host name.
void require_host_names(const std::string& host, std::span<const std::string> cameras);
// The machine's own name without invalid characters; may be empty.
std::string name_of_this_machine();

// What one camera has sent so far.
struct SentFigures {
  std::uint64_t frames = 0;    // written
  std::uint64_t refused = 0;   // by DDS: its queue was full, or the frame too large
  std::uint64_t left_out = 0;  // because the network had not delivered earlier ones (FrameWindow)
  std::uint64_t bytes = 0;
};

// One thread per camera reads and writes. A full DDS queue costs whole frames of that camera only; on a slow network
// whole frames are skipped, for all trackers of that camera alike. Only topics with subscribers are written.
// thread-compatible; sent() and healths() are thread-safe.
class CameraHost {
 public:
  // throws std::invalid_argument, std::runtime_error as DdsParticipant does; or a name is not is_host_name().
  CameraHost(CameraHostOptions options, std::vector<capture::LiveCamera> cameras);
  ~CameraHost();

  void run(const std::stop_token& stop);  // until the stop, or until every source has ended
  struct Event {
    std::string camera;
    capture::CameraEvent event;
  };
  // Publishes the cameras' states and returns their new events. Call about 10 times a second from another thread.
  std::vector<Event> publish_states();
  std::vector<capture::CameraHealth> healths() const;
  std::vector<SentFigures> sent() const;
  std::string description() const;  // of the transport

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::hosts
