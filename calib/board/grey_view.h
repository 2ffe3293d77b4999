// OpenCV images as GreyPixels.
#pragma once

#include <cstddef>
#include <opencv2/core/mat.hpp>

#include "calib/board/board_detector.h"

namespace huetrack::board {

// image: CV_8UC1; must outlive the result.
inline GreyPixels view_of(const cv::Mat& image) {
  return {image.data, image.cols, image.rows, static_cast<std::ptrdiff_t>(image.step)};
}

}  // namespace huetrack::board
