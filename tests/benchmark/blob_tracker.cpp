#include "benchmark/blob_tracker.h"

#include <algorithm>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "pictures/pictures.h"

namespace huetrack::figures {

BlobTracker blob_tracker_for(const calib::CameraRig& rig, const object_tracking::TargetOptions& target) {
  if (target.name == "red")
    return BlobTracker(rig, {{{171, 210, 80}, {178, 255, 145}}, {{169, 120, 140}, {178, 165, 190}}}, 8);
  const HsvRange color{{target.color.hue_min_deg / 2, 0.3 * 255, 0.25 * 255}, {target.color.hue_max_deg / 2, 255, 255}};
  return BlobTracker(rig, std::vector<HsvRange>(rig.cameras.size(), color), 8);
}

BlobTracker::BlobTracker(const calib::CameraRig& rig, std::vector<HsvRange> colors, int min_area)
    : min_area_(min_area) {
  for (const calib::Camera& camera : rig.cameras) {
    PerCamera c;
    c.color = colors[cameras_.size()];
    const auto& lens = std::get<calib::PinholeRadtan>(camera.model.lens());
    c.k = (cv::Mat_<double>(3, 3) << lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1);
    c.distortion = cv::Mat(std::vector<double>(lens.distortion.begin(), lens.distortion.end()), true);
    const Eigen::Matrix3d r = camera.cam_from_world.rotation.toRotationMatrix();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) c.projection(i, j) = r(i, j);
      c.projection(i, 3) = camera.cam_from_world.translation(i);
    }
    cameras_.push_back(std::move(c));
  }
}

std::vector<cv::Point2d> BlobTracker::undistorted(const std::vector<cv::Point2d>& raw, std::size_t camera) const {
  std::vector<cv::Point2d> out;
  if (!raw.empty()) cv::undistortPoints(raw, out, cameras_[camera].k, cameras_[camera].distortion);
  return out;
}

const cv::Mat& BlobTracker::mask_of(const capture::Image& image, std::size_t camera) {
  PerCamera& c = cameras_[camera];
  capture::require_all(image);
  if (image.format == capture::PixelFormat::yuyv) {
    const cv::Mat yuyv(image.height, image.width, CV_8UC2, const_cast<std::uint8_t*>(image.planes[0].data),
                       static_cast<std::size_t>(image.planes[0].stride));
    cv::cvtColor(yuyv, c.bgr, cv::COLOR_YUV2BGR_YUYV);
  } else if (image.format == capture::PixelFormat::bgr) {
    c.bgr = cv::Mat(image.height, image.width, CV_8UC3, const_cast<std::uint8_t*>(image.planes[0].data),
                    static_cast<std::size_t>(image.planes[0].stride));
  } else {
    c.bgr = pictures::bgr_of(image);
  }
  cv::cvtColor(c.bgr, c.hsv, cv::COLOR_BGR2HSV);
  cv::inRange(c.hsv, c.color.low, c.color.high, c.mask);
  return c.mask;
}

std::optional<Eigen::Vector3d> BlobTracker::locate(const capture::FrameSet& set) {
  std::vector<std::pair<std::size_t, cv::Point2d>> seen;  // undistorted, normalised
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    if (!set.frames[i] || set.frames[i]->status != capture::FrameStatus::ok) continue;
    cv::Mat labels, stats, centroids;
    const int n = cv::connectedComponentsWithStats(mask_of(set.frames[i]->pixels, i), labels, stats, centroids);
    int largest = 0;
    for (int label = 1; label < n; ++label) {
      if (largest == 0 || stats.at<int>(label, cv::CC_STAT_AREA) > stats.at<int>(largest, cv::CC_STAT_AREA))
        largest = label;
    }
    if (largest == 0 || stats.at<int>(largest, cv::CC_STAT_AREA) < min_area_) continue;
    const cv::Point2d px(centroids.at<double>(largest, 0), centroids.at<double>(largest, 1));
    seen.emplace_back(i, undistorted({px}, i).front());
  }
  if (seen.size() < 2) return std::nullopt;
  // Direct linear transform over all views, as cv::triangulatePoints does it for two.
  cv::Mat a(static_cast<int>(2 * seen.size()), 4, CV_64F), w, u, vt;
  for (std::size_t s = 0; s < seen.size(); ++s) {
    const cv::Matx34d& p = cameras_[seen[s].first].projection;
    for (int j = 0; j < 4; ++j) {
      a.at<double>(static_cast<int>(2 * s), j) = seen[s].second.x * p(2, j) - p(0, j);
      a.at<double>(static_cast<int>(2 * s) + 1, j) = seen[s].second.y * p(2, j) - p(1, j);
    }
  }
  cv::SVD::compute(a, w, u, vt);
  const double scale = vt.at<double>(3, 3);
  return Eigen::Vector3d(vt.at<double>(3, 0), vt.at<double>(3, 1), vt.at<double>(3, 2)) / scale;
}

}  // namespace huetrack::figures
