// In the place of board_start.cpp where the methods of the camera tracker are left out (HUETRACK_CAMERA_TRACKER=OFF),
// and the detector of boards with them. The file is read all the same, for its mistakes; no tracker comes to ask for
// the start.
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
