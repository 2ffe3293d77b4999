// What a user would write instead with OpenCV: convert every image, threshold the colour, take the largest blob,
// undistort its centre, triangulate. The yardstick of the accuracy and speed figures; no part of huetrack.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::figures {

// OpenCV's 8-bit HSV: hue 0..180, may not wrap.
struct HsvRange {
  cv::Scalar low, high;
};

class BlobTracker {
 public:
  // One range per camera; blobs of fewer pixels than min_area are noise.
  BlobTracker(const calib::CameraRig& rig, std::vector<HsvRange> colors, int min_area);

  // nullopt when fewer than two views have a blob. All views that have one are triangulated together.
  std::optional<Eigen::Vector3d> locate(const capture::FrameSet& set);

  // One camera: the mask of the colour, whole frame. YUYV images are converted as OpenCV does it in one call.
  const cv::Mat& mask_of(const capture::Image& image, std::size_t camera);
  // Raw pixels of one camera as normalised image coordinates; none: none.
  std::vector<cv::Point2d> undistorted(const std::vector<cv::Point2d>& raw, std::size_t camera) const;
  // These from the world.
  const cv::Matx34d& projection(std::size_t camera) const { return cameras_[camera].projection; }

 private:
  struct PerCamera {
    cv::Mat k, distortion;
    cv::Matx34d projection;  // normalised image coordinates from the world
    HsvRange color;
    cv::Mat bgr, hsv, mask;
  };
  int min_area_;
  std::vector<PerCamera> cameras_;
};

// The best that was found for data/rendered (hue as the target's, S > 0.3, V > 0.25: darker pixels have any hue) and,
// from its README, for data/red_square_stereo.
BlobTracker blob_tracker_for(const calib::CameraRig& rig, const object_tracking::TargetOptions& target);

}  // namespace huetrack::figures
