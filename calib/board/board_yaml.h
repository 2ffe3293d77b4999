// Reads and writes the board file; format: calib/formats.md.
#pragma once

#include <filesystem>
#include <string>

#include "calib/board/board.h"

namespace huetrack::board {

Board read_board(const std::filesystem::path& file);  // throws files::ConfigError
std::string to_yaml(const Board& board);              // reads back to the same board

}  // namespace huetrack::board
