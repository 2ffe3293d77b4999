// Camera poses in TUM format, which evo and others read: "timestamp tx ty tz qx qy qz qw", world_from_camera. Measured
// poses only, no predictions.
#pragma once

#include <filesystem>
#include <string>

#include "calib/files/output_file.h"
#include "camera_tracking/camera_estimate.h"

namespace huetrack::tracks {

// Without line end; requires has_pose().
std::string to_tum_line(const camera_tracking::CameraEstimate& estimate);

// thread-compatible.
class PoseFileWriter {
 public:
  // throws std::runtime_error: the file exists and holds something else; all members throw std::system_error
  explicit PoseFileWriter(std::filesystem::path file);
  void write(const camera_tracking::CameraEstimate& estimate);  // ignores states other than tracking
  void flush() { file_.flush(); }

 private:
  files::LineFile file_;
};

}  // namespace huetrack::tracks
