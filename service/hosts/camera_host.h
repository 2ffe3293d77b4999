// A host's cameras, given to trackers on other hosts over DDS (`huetrackd capture`): their frames in their own bytes,
// their state, and the time.
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
  std::string host;                   // how trackers call it
  std::vector<std::string> cameras;   // their names, in the order of the LiveCameras
  std::string program_version;        // told
  idl::ParticipantOptions transport;  // domain, interfaces, profiles
  // What light does to a camera's pictures, in sentences for people; empty: nothing. It goes to the trackers as what is
  // wrong with the camera. Of cameras whose matches are sent; the others' pictures are the trackers' to look at. Called
  // by the cameras' threads. Not set: nothing is said of light.
  std::function<std::string(const capture::LightFindings&)> say_light = nullptr;
};

// The name of a host or of a hosted camera is a part of a topic's name: letters, digits, '_', '-' and '.', one or more.
bool is_host_name(std::string_view name);
// throws std::invalid_argument: the host or one of its cameras has no such name.
void require_host_names(const std::string& host, std::span<const std::string> cameras);
// As the machine calls itself, as far as it may be such a name; it may be empty.
std::string name_of_this_machine();

// What one camera has sent so far.
struct SentFigures {
  std::uint64_t frames = 0;    // written
  std::uint64_t refused = 0;   // by the bus: it was full, or the frame too large
  std::uint64_t left_out = 0;  // as the network had not taken those before (FrameWindow)
  std::uint64_t bytes = 0;
};

// One thread per camera reads and writes; a bus that is full loses whole frames of that camera, and holds up no other;
// of what a slow network cannot take whole frames are left out, for all trackers of that camera alike. Only what
// somebody subscribes to is written. thread-compatible; sent() and healths() are thread-safe.
class CameraHost {
 public:
  // throws std::invalid_argument, std::runtime_error as DdsParticipant does; or a name is no is_host_name().
  CameraHost(CameraHostOptions options, std::vector<capture::LiveCamera> cameras);
  ~CameraHost();

  void run(const std::stop_token& stop);  // until the stop, or until every source has ended
  // About 10 times a second, by another thread: tells who listens how the cameras are, and gives back what they said.
  struct Said {
    std::string camera;
    capture::CameraEvent event;
  };
  std::vector<Said> look_after();
  std::vector<capture::CameraHealth> healths() const;
  std::vector<SentFigures> sent() const;
  std::string description() const;  // of the transport

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::hosts
