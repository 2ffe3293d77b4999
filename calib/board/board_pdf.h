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
  double width_mm = 0;  // in printing orientation
  double height_mm = 0;
};
// "A4", "A3", "A2", "A1", "A0", "letter", "legal", "tabloid", or WIDTHxHEIGHT in millimetres. nullopt: unknown.
std::optional<Paper> paper_of(std::string_view text);

// what(): one line with the size of the board and what would fit.
class DoesNotFit : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct BoardPdf {
  std::string pdf;
  Paper paper;                // in the chosen orientation
  Eigen::Vector2d origin_mm;  // of Board::point's frame, from the paper's top left corner
  Eigen::Vector2d size_mm;    // of the board, without its margin
};

// Rotates the paper if the board fits only then. Leaves a white (inverted: black) margin of at least a quarter of a
// square, which detectors need. throws DoesNotFit; std::invalid_argument: board.problems().
BoardPdf board_pdf(const Board& board, const Paper& paper);

}  // namespace huetrack::board
