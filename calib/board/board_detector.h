// Finds a calibration board in an image.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
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
  std::vector<Eigen::Vector2d> px;  // beside ids; raw pixels, (0,0) is the centre of the top left one
  std::string why_not;              // when ids is empty: what stood in the way, one clause; empty otherwise
  double blur_px = 0;               // standard deviation of its edges' blur, median over the corners; 0: not known
  double marker_m = 0;              // charuco: side of its markers if its squares are as the board says; 0: not known
  double marker_px = 0;             // how large it is in the image; 0: not known

  bool found() const { return !ids.empty(); }
};

// Pure: the same image gives the same corners. Safe to call from many threads.
class BoardDetector {
 public:
  explicit BoardDetector(Board board);  // throws std::invalid_argument: board.problems()

  // A whole board or a part of it. For symmetric boards the way round is the one most upright in the image; see
  // Board::symmetries(); of a chessboard that looks the same from its back the side is taken for the front. A part of a
  // chessboard is used only where its place on the board is certain: the missing rows and columns lie outside the
  // image.
  BoardDetection detect(const GreyPixels& image) const;

  const Board& board() const { return board_; }

 private:
  Board board_;
};

// Why a board file may not fit its images, when (nearly) no image shows the board: tries what people get wrong (inner
// corners counted as squares, another dictionary, inverted, the old charuco layout). One sentence, or empty.
std::string explain_missing_board(const Board& board, const std::vector<GreyPixels>& images);

// What is wrong when most of these images show the board's markers with columns for rows, as of [8, 11] for [11, 8].
// One sentence, or empty. A few images, of which little is seen, may fit such a board file all the same.
std::string explain_transposed_board(const Board& board, const std::vector<GreyPixels>& images);

}  // namespace huetrack::board
