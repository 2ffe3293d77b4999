// A calibration board as a PDF to print: vectors at true scale, with a ruler to check the printer by.
#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "calib/board/board.h"

namespace huetrack::board {

struct Paper {
  std::string name;
  double width_mm = 0;  // as it is printed: the board lies along it
  double height_mm = 0;
};
// "A4", "A3", "A2", "A1", "A0", "letter", "legal", "tabloid", or WIDTHxHEIGHT in millimetres. nullopt: none of these.
std::optional<Paper> paper_of(std::string_view text);

// what() is one line that says how large the board is, and what would fit.
class DoesNotFit : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct BoardPdf {
  std::string pdf;
  Paper paper;                // as it was turned
  Eigen::Vector2d origin_mm;  // where Board::point's origin lies on it, from the top left corner
  Eigen::Vector2d size_mm;    // of the board, without its margin
};

// Turns the paper when the board fits only so. Around the board stays a white (inverted: black) margin of at least a
// quarter of a square, which detectors need. throws DoesNotFit; std::invalid_argument: board.problems().
BoardPdf board_pdf(const Board& board, const Paper& paper);

}  // namespace huetrack::board
