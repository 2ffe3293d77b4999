// The rendered LED sequence: its files, its truth, and how a tracker does on it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "camera_tracking/camera_tracker.h"
#include "capture/frames/frame.h"

namespace huetrack::figures {

struct LedSequence {
  calib::CameraRig rig;
  camera_tracking::LedStart start;  // LEDs, schedule and room
  std::vector<capture::Frame> frames;
  std::vector<calib::Rigid3d> world_from_camera;  // truth, per frame
};

std::optional<LedSequence> load_led_sequence(const std::filesystem::path& folder);  // nullopt: it is not there

struct PoseError {
  double metres = 0;   // the length of the vector from the estimated to the true position
  double degrees = 0;  // the angle of the one rotation from the estimated to the true orientation
};
PoseError pose_error(const calib::Rigid3d& estimate, const calib::Rigid3d& truth);

// e^T C^-1 e of the six errors of a pose.
double pose_nees(const camera_tracking::CameraEstimate& estimate, const calib::Rigid3d& truth);

}  // namespace huetrack::figures
