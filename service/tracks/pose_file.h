// A camera's poses as TUM text, which evo and others read: "timestamp tx ty tz qx qy qz qw", camera to world. Only
// what the view supports: no line of the file is a prediction.
#pragma once

#include <filesystem>
#include <string>

#include "calib/files/output_file.h"
#include "camera_tracking/camera_estimate.h"

namespace huetrack::tracks {

std::string to_tum_line(
    const camera_tracking::CameraEstimate& estimate);  // without the line's end; requires has_pose()

// thread-compatible.
class PoseFileWriter {
 public:
  // throws std::system_error, naming the file, as the others do; std::runtime_error: something else than poses is there
  explicit PoseFileWriter(std::filesystem::path file);
  void write(const camera_tracking::CameraEstimate& estimate);  // nothing in states but tracking
  void flush();

 private:
  files::LineFile file_;
};

}  // namespace huetrack::tracks
