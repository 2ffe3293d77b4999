// Detection of a grid of circles. Private to this module.
#pragma once

#include <opencv2/core.hpp>

#include "calib/board/board_detector.h"

namespace huetrack::board {

// The whole board or nothing. Each point is the centre of area of a circle's image, not the image of its centre.
BoardDetection detect_circles(const Board& board, const cv::Mat& image);

}  // namespace huetrack::board
