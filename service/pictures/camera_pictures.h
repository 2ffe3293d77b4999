// Pictures of what a camera tracker saw and thought: per frame one PNG with the features, their search regions and the
// particles on the left, and on the right the same frame with the world's axes at its origin and a wireframe house that
// stands on the start's plane: it stands still if the pose holds. At the end one PNG of the map and the way of the
// camera in 3-D. For people only.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <opencv2/core.hpp>
#include <vector>

#include "config/service_config.h"
#include "pictures/picture_job.h"

namespace huetrack::pictures {

// Where the start lies, and so where the house stands. World frame, metres.
struct StartPlane {
  Eigen::Vector3d origin{0, 0, 0};  // its centre
  Eigen::Vector3d x{1, 0, 0}, y{0, 1, 0}, up{0, 0, 1};
  double size_x = 0.2, size_y = 0.2;
};
StartPlane start_plane(const config::CameraTrackingConfig& config);

cv::Mat draw_camera(const calib::Camera& camera, const StartPlane& plane, const CameraPictureJob& job);

// The map with its 95 % ellipsoids, the way, and the world's axes where its origin is not far from them.
cv::Mat draw_camera_map(const calib::Camera& camera, const StartPlane& plane, const std::string& title,
                        const std::vector<camera_tracking::CameraEstimate>& way,
                        const std::vector<camera_tracking::CameraMapPoint>& map);

// thread-compatible: write() by the camera's picture thread, finish() afterwards.
class CameraPictureWriter {
 public:
  // Makes the folder if needed. throws std::runtime_error, naming it; so do the others
  CameraPictureWriter(const config::ServiceConfig& config, std::filesystem::path folder);

  void write(const CameraPictureJob& job);  // <folder>/camera_<number>.png
  void finish(const std::string& title, const std::vector<camera_tracking::CameraEstimate>& way,
              const std::vector<camera_tracking::CameraMapPoint>& map);  // camera_3d.png
  std::size_t written() const { return written_; }

 private:
  void save(const std::string& name, const cv::Mat& picture);

  const calib::Camera& camera_;
  StartPlane plane_;
  std::filesystem::path folder_;
  std::size_t written_ = 0;
};

}  // namespace huetrack::pictures
