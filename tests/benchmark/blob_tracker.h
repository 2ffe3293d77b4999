// What a user would write instead with OpenCV: convert every image, threshold the colour, take the largest blob, undistort
// its centre, triangulate. The yardstick of the accuracy and speed figures; no part of huetrack.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frame.h"
#include "object_tracking/object_tracker.h"

namespace huetrack {

class BlobTracker {
 public:
  BlobTracker(const CameraRig& rig, const TargetOptions& target);

  // nullopt when fewer than two views have a blob. All views that have one are triangulated together.
  std::optional<Eigen::Vector3d> locate(const FrameSet& set);

  // One camera: the mask of the colour, whole frame. YUYV images are converted as OpenCV does it in one call.
  const cv::Mat& mask_of(const Image& image, std::size_t camera);

 private:
  struct PerCamera {
    cv::Mat k, distortion;
    cv::Matx34d projection;              // normalised image coordinates from the world
    cv::Scalar low, high;
    bool hue_wraps;
    cv::Mat bgr, hsv, mask, other;
  };
  std::vector<PerCamera> cameras_;
};

}  // namespace huetrack
