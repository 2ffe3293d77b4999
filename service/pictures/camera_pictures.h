// Pictures of the camera tracker, for people: per frame one PNG, left with features, search regions and particles,
// right with the world's axes and a wireframe house on the start's plane, which stands still if the pose is right; at
// the end one PNG with map and trajectory in 3-D.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <opencv2/core.hpp>
#include <vector>

#include "config/service_config.h"
#include "pictures/picture_job.h"

namespace huetrack::pictures {

// The start's plane, for the house. World frame, metres.
struct StartPlane {
  Eigen::Vector3d origin{0, 0, 0};  // its centre
  Eigen::Vector3d x{1, 0, 0}, y{0, 1, 0}, up{0, 0, 1};
  double size_x = 0.2, size_y = 0.2;
};
StartPlane start_plane(const config::CameraTrackingConfig& config);

cv::Mat draw_camera(const calib::Camera& camera, const StartPlane& plane, const CameraPictureJob& job);

// The map with 95 % ellipsoids, the trajectory, and the world's axes if its origin is near.
cv::Mat draw_camera_map(const calib::Camera& camera, const StartPlane& plane, const std::string& title,
                        const std::vector<camera_tracking::CameraEstimate>& path,
                        const std::vector<camera_tracking::CameraMapPoint>& map);

// thread-compatible: write() by the camera's picture thread, finish() afterwards.
class CameraPictureWriter {
 public:
  // Creates the folder if needed. All functions throw std::runtime_error, naming it.
  CameraPictureWriter(const config::ServiceConfig& config, std::filesystem::path folder);

  void write(const CameraPictureJob& job);  // <folder>/camera_<number>.png
  void finish(const std::string& title, const std::vector<camera_tracking::CameraEstimate>& path,
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
