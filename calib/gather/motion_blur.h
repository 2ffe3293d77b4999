// A board that is smeared by motion, told from one that is not there without finding it.
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

namespace huetrack::gather {

// As PictureTally::why_not has it.
inline constexpr const char* motion_blur_reason = "the board is smeared by motion";

// The pictures of one camera, one after the other. What tells a smear is the place where the board was shortly before:
// light and dark are there still, in most of it, but in some direction hardly an edge is sharp. Shelves may look like
// that where the board has gone: it is certain when the board is found there again shortly after. thread-compatible.
class MotionBlurDetector {
 public:
  // Returns in how many of the pictures since the last one that had a board it was smeared for certain: the first ones
  // for which may_be_in() was true.
  int found(const cv::Mat& grey, const std::vector<Eigen::Vector2d>& corners);
  // A picture in which no board was found. False: nothing tells, or the board is not where it was.
  bool may_be_in(const cv::Mat& grey);

 private:
  struct Place {
    cv::Rect box;
    double square_px = 0;
    std::vector<double> contrast;   // per cell of the box
    std::vector<double> sharpness;  // per direction
  };
  static void measure(const cv::Mat& grey, Place& place);

  std::optional<Place> place_;
  int pictures_since_ = 0, smeared_since_ = 0;
};

}  // namespace huetrack::gather
