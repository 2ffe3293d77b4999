// A board before cameras that are known already: what `check` and `world` look at.
#pragma once

#include <filesystem>
#include <span>
#include <stop_token>
#include <string>

#include "calib/gather/find_boards.h"
#include "calib/model/camera_rig.h"

namespace huetrack::program {

// As find_boards(), with BoardView::camera indexing the rig. Cameras of the rig that the inputs lack are left out with
// a line on stderr; so are those of the inputs that the rig lacks.
// throws InputError: no camera of the rig in the inputs, pictures of another size than the rig's
gather::FoundBoards board_views_of(const calib::CameraRig& rig, const std::filesystem::path& rig_file,
                                   const board::Board& board, std::span<const std::string> inputs,
                                   const gather::FindBoardsOptions& options, std::stop_token stop);

// throws InputError: they are of another size than the one that the camera was calibrated at
void require_size(const calib::Camera& camera, calib::ImageSize pictures, const std::filesystem::path& rig_file);

// Sets one line of made_by, in place of one under the same key.
void note_in(calib::CameraRig& rig, const std::string& key, const std::string& text);

}  // namespace huetrack::program
