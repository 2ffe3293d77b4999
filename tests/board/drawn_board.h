// A board as it is printed, and what a camera sees of it: for tests that need boards of every kind.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calib/board/board.h"

namespace huetrack::board {

struct DrawnBoard {
  cv::Mat image;              // 8 bit grey
  Eigen::Vector2d origin_px;  // of the board frame; pixel centres are whole numbers
  double px_per_m = 0;
  Eigen::Vector2d pixel(const Eigen::Vector3d& point) const { return origin_px + px_per_m * point.head<2>(); }
};

// Discs around the board's points, antialiased.
inline DrawnBoard draw_circles(const Board& board, int square_px, double margin) {
  DrawnBoard drawn;
  drawn.px_per_m = square_px / board.pitch.x();
  const double border = (margin + 1) * square_px, radius = board.diameter / 2 * drawn.px_per_m;
  drawn.origin_px.setConstant(border);
  const Eigen::Vector2d last =
      drawn.pixel({board.pitch.x() * (board.type == BoardType::circles ? board.columns - 1 : 2 * board.columns - 1),
                   board.pitch.y() * (board.rows - 1), 0});
  drawn.image =
      cv::Mat(static_cast<int>(last.y() + border), static_cast<int>(last.x() + border), CV_8UC1, cv::Scalar(255));
  for (int id = 0; id < board.point_count(); ++id) {
    const Eigen::Vector2d centre = drawn.pixel(board.point(id));
    for (int y = static_cast<int>(centre.y() - radius - 2); y < centre.y() + radius + 2; ++y) {
      for (int x = static_cast<int>(centre.x() - radius - 2); x < centre.x() + radius + 2; ++x) {
        const double inside = std::clamp(radius + 0.5 - (Eigen::Vector2d(x, y) - centre).norm(), 0.0, 1.0);
        if (inside > 0) drawn.image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(std::lround(255 * (1 - inside)));
      }
    }
  }
  if (board.inverted) drawn.image = 255 - drawn.image;
  return drawn;
}

// Drawn square by square from the definition of the board types, not with the code under test. margin: of white, in
// squares. turned_codes: by half, as other tools than OpenCV print AprilTags.
inline DrawnBoard draw_board(const Board& board, int square_px = 120, double margin = 1, bool turned_codes = false) {
  if (board.has_circles()) return draw_circles(board, square_px, margin);
  DrawnBoard drawn;
  drawn.px_per_m = square_px / board.pitch.x();
  const bool grid = board.type == BoardType::aruco_grid;
  const int columns = board.type == BoardType::chessboard ? board.columns + 1 : board.columns;
  const int rows = board.type == BoardType::chessboard ? board.rows + 1 : board.rows;
  const int border = static_cast<int>(margin * square_px);
  drawn.image = cv::Mat(rows * square_px + 2 * border, columns * square_px + 2 * border, CV_8UC1, cv::Scalar(255));
  // The edge between two squares lies between two pixels. Corner 0 is one square in.
  drawn.origin_px.setConstant(border + (grid ? 0 : square_px) - 0.5);
  const auto dictionary = [&] {
    for (const auto& known : marker_dictionaries()) {
      if (known.name == board.dictionary) return cv::aruco::getPredefinedDictionary(known.opencv_id);
    }
    return cv::Ptr<cv::aruco::Dictionary>();
  }();
  const int marker_px = static_cast<int>(std::lround(board.marker * drawn.px_per_m));
  if (board.from_bottom) drawn.origin_px.y() += (rows - 1) * square_px + marker_px;
  int marker = board.first_marker;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const cv::Rect square(border + column * square_px, border + row * square_px, square_px, square_px);
      const bool first_white = board.legacy && board.rows % 2 == 0;
      if (!grid && (row + column) % 2 == (first_white ? 1 : 0)) {
        drawn.image(square) = 0;
      } else if (board.type != BoardType::chessboard) {
        const int inset = grid ? 0 : (square_px - marker_px) / 2;
        cv::Mat code;
        dictionary->drawMarker(marker++, marker_px, code, board.border_bits);
        if (turned_codes) cv::rotate(code, code, cv::ROTATE_180);
        const int y = board.from_bottom ? border + (rows - 1 - row) * square_px : square.y + inset;
        code.copyTo(drawn.image(cv::Rect(square.x + inset, y, marker_px, marker_px)));
      }
    }
  }
  if (board.inverted) drawn.image = 255 - drawn.image;
  return drawn;
}

// Seen through a homography (drawn pixels to image pixels), soft and with sensor noise.
inline cv::Mat seen_through(const cv::Mat& drawn, const cv::Matx33d& h, cv::Size size, double noise,
                            std::uint64_t seed) {
  cv::Mat big, image;
  const cv::Matx33d up(4, 0, 1.5, 0, 4, 1.5, 0, 0, 1);  // drawn at four times the size, for antialiasing
  cv::warpPerspective(drawn, big, up * h, size * 4, cv::INTER_AREA, cv::BORDER_CONSTANT, cv::Scalar(128));
  cv::GaussianBlur(big, big, {}, 3.0);
  cv::resize(big, image, size, 0, 0, cv::INTER_AREA);
  cv::Mat grain(size, CV_8UC1);
  cv::RNG rng(seed);
  cv::Mat_<float> sum;
  image.convertTo(sum, CV_32F, 0.7, 30);
  cv::Mat_<float> normal(size);
  rng.fill(normal, cv::RNG::NORMAL, 0, noise);
  sum += normal;
  sum.convertTo(image, CV_8U);
  return image;
}

}  // namespace huetrack::board
