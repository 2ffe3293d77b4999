// Start pose of a tracked camera from a calibration board on the ground.
#pragma once

#include <filesystem>

#include "camera_tracking/camera_tracker.h"

namespace huetrack::config {

// file: board file (calib/board/board_yaml.h). World: origin at the board's first corner, z up. throws as read_board()
camera_tracking::FoundStart board_start(const std::filesystem::path& file);

}  // namespace huetrack::config
