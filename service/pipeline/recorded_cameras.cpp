#include "pipeline/recorded_cameras.h"

#include <algorithm>
#include <utility>

namespace huetrack::pipeline {

SessionSources recorded_cameras(const recordings::Recording& recording, const recordings::ReplaySource& source) {
  std::vector<SessionCamera> known;
  for (const auto& camera : source.cameras())
    known.push_back({.camera = int(known.size()),
                     .period = camera.frame_period,
                     .pixels = SessionCamera::Pixels{camera.format, camera.range}});
  SessionSources sources;
  sources.cameras = [known = std::move(known)] { return known; };
  // Our own recordings repeat the order of arrival, and so the live sets; others are merged by capture time.
  sources.is_ascending = std::ranges::all_of(
      recording.cameras, [](const auto& camera) { return camera.received.empty() && camera.corrupted.empty(); });
  return sources;
}

}  // namespace huetrack::pipeline
