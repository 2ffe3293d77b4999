// A camera's poses as TUM text, which evo and others read: "timestamp tx ty tz qx qy qz qw", camera to world. Only
// what the view supports: no line of the file is a prediction.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "camera_tracking/camera_estimate.h"

namespace huetrack::tracks {

std::string to_tum_line(
    const camera_tracking::CameraEstimate& estimate);  // without the line's end; requires has_pose()

// thread-compatible.
class PoseFileWriter {
 public:
  explicit PoseFileWriter(std::filesystem::path file);  // throws std::system_error, naming the file; so do the others
  void write(const camera_tracking::CameraEstimate& estimate);  // nothing in states but tracking
  void flush();

 private:
  std::filesystem::path file_;
  std::ofstream stream_;
};

}  // namespace huetrack::tracks
