// Where a camera starts: found by a calibration board on the ground.
#pragma once

#include <filesystem>

#include "camera_tracking/camera_tracker.h"

namespace huetrack::config {

// file: the board's (calib/board/board_yaml.h). The world is the board's: its first corner, z up. throws as
// read_board()
camera_tracking::FoundStart board_start(const std::filesystem::path& file);

}  // namespace huetrack::config
