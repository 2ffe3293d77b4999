// Between OpenCV's images and the canvas.
#pragma once

#include <opencv2/core.hpp>

#include "drawing/canvas.h"

namespace huetrack::pictures {

// A canvas with an image on it: its pixels stay visible as squares. top_left: of the image on the canvas; where the
// image does not reach, the background.
//   bgr    8-bit; empty: only the background
drawing::Canvas canvas_over(const cv::Mat& bgr, const drawing::Point& top_left, double zoom, cv::Size size,
                            drawing::Color background);

cv::Mat image_of(const drawing::Canvas& canvas);  // 8-bit BGR

}  // namespace huetrack::pictures
