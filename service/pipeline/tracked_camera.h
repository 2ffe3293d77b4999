// What is said and kept of the tracked camera, by run and replay alike.
#pragma once

#include <filesystem>
#include <limits>
#include <optional>
#include <set>
#include <string>

#include "camera_tracking/camera_tracker.h"

namespace huetrack::pipeline {

// A plain value: the tracked camera after its last frame.
struct TrackedCameraFigures {
  camera_tracking::PoseState state = camera_tracking::PoseState::searching;
  capture::Timestamp at;  // capture time of the last frame
  std::optional<capture::Timestamp>
      without_since;      // capture time of the first frame without a pose; nullopt: there is one
  std::string why;        // what the tracker said last why there is none; empty: nothing
  bool had_pose = false;  // in some frame
  // Of its rolling shutter, CameraEstimate; NaN: the method does not ask, or nothing is known yet.
  double readout_s = std::numeric_limits<double>::quiet_NaN();
  double readout_sigma_s = std::numeric_limits<double>::quiet_NaN();

  void add(const camera_tracking::CameraEstimate& estimate, const std::string& why_no_pose);
};

// "camera cam0: no pose for 12 s (lost): ..."; empty as long as that is nothing to speak of: for less than 3 s of
// capture time, or where there is a pose.
std::string no_pose_warning(const std::string& camera, const TrackedCameraFigures& figures);

// "rows over 29.5 ms +- 0.5"; empty as long as its motion has not told it to 2 ms.
std::string readout_text(const TrackedCameraFigures& figures);

// Into the log, and each sentence (without its numbers) once until there is a pose again, for two of them may
// alternate. thread-compatible.
class NoPoseLog {
 public:
  void tell(const std::string& camera, const TrackedCameraFigures& figures);

 private:
  std::set<std::string> told_;
};

// Writes the map, or says in one line of the log that there is none to be kept: an earlier file then stays as it is.
// throws std::runtime_error naming the file
void save_map(const camera_tracking::CameraTracker& tracker, const TrackedCameraFigures& figures,
              const std::filesystem::path& file);

}  // namespace huetrack::pipeline
