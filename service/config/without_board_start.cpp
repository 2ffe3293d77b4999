// Replaces board_start.cpp if built with HUETRACK_CAMERA_TRACKER=OFF, without the board detector. Still validates the
// file.
#include <stdexcept>

#include "calib/board/board_yaml.h"
#include "config/board_start.h"

namespace huetrack::config {

camera_tracking::FoundStart board_start(const std::filesystem::path& file) {
  board::read_board(file);
  return {[](const capture::Image&) -> std::optional<camera_tracking::PointsStart> {
    throw std::logic_error("boards are not found: built with HUETRACK_CAMERA_TRACKER=OFF");
  }};
}

}  // namespace huetrack::config
