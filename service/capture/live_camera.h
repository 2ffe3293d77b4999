// A camera that delivers now, wherever it is: at this host (V4l2Source), at another one (hosts/hosted_camera.h), or
// what a test puts in its place.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "capture/frames/frame_source.h"
#include "capture/v4l2_source.h"

namespace huetrack::capture {

struct LiveCamera {
  int camera = 0;                                         // in the rig
  std::unique_ptr<FrameSource> source;                    // nullptr: another camera's gives its frames, too
  std::function<CameraHealth()> health;                   // thread-safe while source lives
  std::function<std::vector<CameraEvent>()> take_events;  // thread-safe while source lives
  std::shared_ptr<CameraControls> controls = nullptr;     // nullptr: they cannot be reached from here
  // Of one whose frames say which pixels match: tells it the colours, from now on. nullptr: pixels come. thread-safe,
  // and may outlive source.
  std::function<void(std::span<const MatchedColor>)> look_for = nullptr;
  // Where outlines were in such a camera's frame of that number (Frame::sequence), and how they move; after all of a
  // set's, tell_outlines() tells it what was said so of it and of the other cameras of its host. Their next frames then
  // have pixels there, as far as they get to know it in time. thread-safe, and may outlive source.
  std::function<void(std::uint32_t, std::span<const ExpectedOutline>)> expect_outlines = nullptr;
  std::function<void()> tell_outlines = nullptr;
};

}  // namespace huetrack::capture
