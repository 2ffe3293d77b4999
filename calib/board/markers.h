// Markers in an image, and which of them a board explains. Private to this module.
#pragma once

#include <map>
#include <opencv2/core.hpp>
#include <vector>

#include "calib/board/board.h"

namespace huetrack::board {

using MarkerCorners = std::vector<cv::Point2f>;  // pixels, clockwise from the marker's own top left one
using Markers = std::map<int, MarkerCorners>;    // by id

cv::Mat upright_colours(const cv::Mat& image, bool inverted);

// All markers of the board's dictionary, colours and border, whatever their ids.
Markers find_markers(const cv::Mat& image, const Board& board);

struct MarkerFit {
  // The board's markers that lie where the others predict them, their corners clockwise from the top left one on the
  // board (tools print a code in any of four orientations; AprilTags turned by half against OpenCV's).
  Markers fitting;
  // Markers elsewhere than the board file says: of the board and off its plane's grid, or on its grid, next to
  // `fitting`, with ids that the board does not have.
  int contradicting = 0;

  // One in four: more than codes that are found by chance, or misread.
  bool contradicts() const { return contradicting >= 2 && 4 * contradicting > contradicting + int(fitting.size()); }
};

MarkerFit fit_markers(const Markers& found, const Board& board);

}  // namespace huetrack::board
