// Cameras that play a recording as if they saw it now, for `huetrackd demo`.
#pragma once

#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "capture/frames/frame.h"
#include "capture/live_camera.h"
#include "recordings/recording.h"

namespace huetrack::daemon {

// A short recording in memory. Cameras deliver it forwards and backwards in turn, without end, so that no object ever
// jumps. Immutable: thread-safe.
class DemoFilm {
 public:
  // Decodes every frame; they keep their JPEG bytes, as a webcam's do. throws ConfigError; std::runtime_error: the
  // cameras do not have the same number of frames (two at least) at one rate.
  DemoFilm(const recordings::Recording& recording, std::vector<std::string> cameras, const std::stop_token& stop = {});

  const std::vector<std::string>& cameras() const { return cameras_; }
  std::size_t length() const { return frames_.front().size(); }  // frames of each camera
  capture::Duration period() const { return period_; }
  // The k-th picture that a camera delivers. Its time is the recording's.
  const capture::Frame& at(std::size_t camera, std::uint64_t k) const;

 private:
  const std::vector<std::string> cameras_;
  std::vector<std::vector<capture::Frame>> frames_;  // by camera
  capture::Duration period_{0};
};

// One for each camera of the film that this rig has, with the same capture times, from now on. A reader that comes late
// misses frames, as at a camera.
std::vector<capture::LiveCamera> demo_cameras(const std::shared_ptr<const DemoFilm>& film,
                                              std::span<const std::string> rig_cameras);

}  // namespace huetrack::daemon
