// Views of a board for a calibration, from files or live cameras.
#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "calib/gather/find_boards.h"
#include "calib/gather/live_cameras.h"

namespace huetrack::gather {

struct LiveOptions {
  std::filesystem::path file;  // configuration of live cameras; empty: devices are in the inputs
  LiveSettings settings;
  std::optional<double> seconds;
  std::filesystem::path page;  // DetectionPage; empty: none
};

// inputs: as for open_pictures(), or NAME=/dev/... . alone: a single camera (open_pictures_of()).
struct GatherOptions {
  PictureOptions pictures;
  bool alone = false;
  FindBoardsOptions find;
  LiveOptions live;
};
FoundBoards gather_boards(const std::vector<std::string>& inputs, const board::Board& board,
                          const GatherOptions& options, std::stop_token stop);

}  // namespace huetrack::gather
