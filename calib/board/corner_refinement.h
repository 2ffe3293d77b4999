// Subpixel refinement of a chessboard corner. Private to this module.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>

namespace huetrack::board {

struct RefinedCorner {
  Eigen::Vector2d px;
  double contrast = 0;  // half the difference of bright and dark squares, grey values
  double blur_px = 0;   // standard deviation of the edges' blur
  double residual = 0;  // rms of image minus model, grey values
};

// Fits two crossing, blurred edges to the pixels around `start` (up to half a square away): position, directions, blur,
// contrast and brightness, by least squares. Uses exactly the pixels with information on the corner, which squares of a
// few pixels need; on large squares it agrees with cv::cornerSubPix.
//   image            8 bit grey
//   step_i, step_j   to the neighbouring corners, pixels
//   dark             whether the square between -step_i and -step_j is dark
//   white_margin     bright squares have content (a marker) beyond this distance from their edges, in steps
// nullopt: no such corner (it drifts away, or has the other polarity or too little contrast), or outside the image.
std::optional<RefinedCorner> refine_corner(const cv::Mat& image, const Eigen::Vector2d& start,
                                           const Eigen::Vector2d& step_i, const Eigen::Vector2d& step_j, bool dark,
                                           double white_margin = 1);

}  // namespace huetrack::board
