// Finds a calibration board in an image.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "calib/board/board.h"

namespace huetrack::board {

// An 8-bit grey image, lent for a call.
struct GreyPixels {
  const std::uint8_t* data = nullptr;
  int width = 0;  // pixels
  int height = 0;
  std::ptrdiff_t stride = 0;  // bytes from one row to the next
};

struct BoardDetection {
  std::vector<int> ids;             // ascending; of Board::point()
  std::vector<Eigen::Vector2d> px;  // one per id; raw pixels, (0,0) is the centre of the top left one
  std::string why_not;              // if ids is empty: the reason, one clause
  double blur_px = 0;               // standard deviation of the edges' blur, median over the corners; 0: unknown
  double marker_m = 0;              // measured, given the pitch: side of the markers, diameter; 0: unknown
  double marker_px = 0;             // size in the image; 0: unknown
  int markers = 0;                  // of the board, where the board file says
  int contradicting_markers = 0;    // elsewhere, or beside them and not of the board

  bool found() const { return !ids.empty(); }
};

// Pure: the same image gives the same corners. Safe to call from many threads.
class BoardDetector {
 public:
  explicit BoardDetector(Board board);  // throws std::invalid_argument: board.problems()

  // A whole board or a part of it. Of the orientations of a symmetric board (Board::symmetries()) the most upright one
  // in the image; a chessboard that looks the same from its back counts as the front. A part of a chessboard is used
  // only if its place on the board is certain: the missing rows and columns lie outside the image.
  BoardDetection detect(const GreyPixels& image) const;

  const Board& board() const { return board_; }

 private:
  Board board_;
};

// Why (nearly) no image shows the board: tests the usual mistakes of a board file (squares counted as inner corners,
// another dictionary, inverted, ...). One sentence, or empty.
std::string explain_missing_board(const Board& board, const std::vector<GreyPixels>& images);

// The change of the board file that explains the markers in these images, as it is written there: "legacy: true".
// Tried: legacy, columns and rows swapped or other counts, numbering from the bottom, first marker, border, dictionary,
// inverted. Empty: none is clearly better. Some seconds of work.
std::string fitting_board_file(const Board& board, const std::vector<GreyPixels>& images);

}  // namespace huetrack::board
