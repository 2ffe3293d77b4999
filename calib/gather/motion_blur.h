// Detects a board that is blurred by motion, as opposed to an absent one.
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

namespace huetrack::gather {

// In PictureTally::why_not.
inline constexpr const char* motion_blur_reason = "the board is blurred by motion";

// Processes the images of one camera in order. Criterion: where the board was shortly before there is still contrast,
// but in some direction hardly an edge is sharp. The background may look like that, so a blur counts only once the
// board is found again at that place shortly after. thread-compatible.
class MotionBlurDetector {
 public:
  // For an image with a board. Returns the number of blurred images since the previous one with a board: the first ones
  // for which may_be_in() was true.
  int found(const cv::Mat& grey, const std::vector<Eigen::Vector2d>& corners);
  // For an image without a detection. False: no evidence of blur.
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
  int pictures_since_ = 0, blurred_since_ = 0;
};

}  // namespace huetrack::gather
