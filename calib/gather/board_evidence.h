// What the images say of the board file: whether the markers lie where it says, and whether its lengths fit together.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "calib/board/board_detector.h"

namespace huetrack::gather {

class BoardEvidence {
 public:
  explicit BoardEvidence(board::Board board) : board_(std::move(board)) {}

  void add(const board::BoardDetection& detection, const cv::Mat& grey);

  // A contradiction between images and board file, as one sentence; may be empty.
  std::string doubt() const;
  // throws InputError if the markers contradict the board file and another one fits: the message says what to write.
  void refuse_wrong_board() const;
  // The board of the file, with the measured diameter of its circles if the file has none.
  board::Board board() const;

 private:
  bool contradicts() const;
  std::string contradiction() const;
  std::string doubt_of_lengths() const;

  board::Board board_;
  int images_ = 0, contradicting_images_ = 0;  // with markers of the board
  int markers_ = 0, contradicting_ = 0;
  int in_consistent_ = 0, in_contradicting_ = 0;  // markers in images that show enough of the board to tell
  std::vector<double> sides_m_, sides_px_;        // measured, per view
  std::vector<cv::Mat> contradicting_samples_;
};

}  // namespace huetrack::gather
