// Views of a board by calibrated cameras, for `check` and `world`.
#pragma once

#include <filesystem>
#include <span>
#include <stop_token>
#include <string>

#include "calib/gather/find_boards.h"
#include "calib/model/camera_rig.h"

namespace huetrack::program {

// As find_boards(), with BoardView::camera indexing the rig. Cameras in only one of rig and inputs are omitted with a
// line on stderr.
// throws InputError: no camera in common, or an image size other than the rig's
gather::FoundBoards board_views_of(const calib::CameraRig& rig, const std::filesystem::path& rig_file,
                                   const board::Board& board, std::span<const std::string> inputs,
                                   const gather::FindBoardsOptions& options, std::stop_token stop);

// throws InputError: the images have another size than in the calibration
void require_size(const calib::Camera& camera, calib::ImageSize pictures, const std::filesystem::path& rig_file);

// Sets one entry of made_by.
void note_in(calib::CameraRig& rig, const std::string& key, const std::string& text);

}  // namespace huetrack::program
