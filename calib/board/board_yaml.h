// The board file: which calibration board is used. Its form is documented in calib/formats.md.
#pragma once

#include <filesystem>
#include <string>

#include "calib/board/board.h"

namespace huetrack::board {

Board read_board(const std::filesystem::path& file);  // throws ConfigError
std::string to_yaml(const Board& board);              // reads back to the same board

}  // namespace huetrack::board
