#include "calib/board/board_yaml.h"
#include "calib/files/config_error.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(board) {
  try {
    board::to_yaml(board::read_board(fuzz::file_with("board.yaml", input)));
  } catch (const files::ConfigError&) {
  }
}
