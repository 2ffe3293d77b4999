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

// Shares the pixels, which must not be written to: OpenCV has no read-only Mat.
inline cv::Mat mat_of(const GreyPixels& image) {
  return cv::Mat(image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.data),
                 static_cast<std::size_t>(image.stride));
}

}  // namespace huetrack::board
