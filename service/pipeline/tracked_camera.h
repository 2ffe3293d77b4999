// Figures, warnings and map of the tracked camera, for run and replay.
#pragma once

#include <filesystem>
#include <limits>
#include <optional>
#include <set>
#include <string>

#include "camera_tracking/camera_tracker.h"

namespace huetrack::pipeline {

// State after the last frame.
struct TrackedCameraFigures {
  camera_tracking::PoseState state = camera_tracking::PoseState::searching;
  capture::Timestamp at;  // capture time of the last frame
  std::optional<capture::Timestamp>
      without_since;      // capture time of the first frame without a pose; nullopt: it has a pose
  std::string why;        // the tracker's last reason; empty: none
  bool had_pose = false;  // in some frame
  // Rolling shutter, as in CameraEstimate; NaN: unknown.
  double readout_s = std::numeric_limits<double>::quiet_NaN();
  double readout_sigma_s = std::numeric_limits<double>::quiet_NaN();

  void add(const camera_tracking::CameraEstimate& estimate, const std::string& why_no_pose);
};

// "camera cam0: no pose for 12 s (lost): ..."; empty in the first 3 s of capture time, or if it has a pose.
std::string no_pose_warning(const std::string& camera, const TrackedCameraFigures& figures);

// "readout 29.5 ms +- 0.5"; empty if its sigma exceeds 2 ms.
std::string readout_text(const TrackedCameraFigures& figures);

// Logs each warning (ignoring its numbers) once until there is a pose again. thread-compatible.
class NoPoseLog {
 public:
  void log(const std::string& camera, const TrackedCameraFigures& figures);

 private:
  std::set<std::string> logged_;
};

// Writes the map; if there never was a pose, logs that and keeps an earlier file. throws std::runtime_error naming the
// file
void save_map(const camera_tracking::CameraTracker& tracker, const TrackedCameraFigures& figures,
              const std::filesystem::path& file);

}  // namespace huetrack::pipeline
