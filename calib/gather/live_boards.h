// Gathers views of a board from live cameras, and tells the one who carries it what is still missing.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "calib/board/board_detector.h"
#include "calib/gather/detection_page.h"
#include "calib/gather/find_boards.h"
#include "capture/frames/frame_source.h"

namespace huetrack::gather {

struct LiveBoardsOptions {
  std::optional<double> seconds;  // end so long after the start; nullopt: when nothing is missing, or at the stop
  capture::Duration tolerance = capture::duration_of(0.017);  // of a frame set
  bool until_enough = true;                                   // end when nothing is missing
  bool progress = true;
  std::filesystem::path page;                               // see DetectionPage; empty: none
  std::function<void(const std::string& status)> looked{};  // after every look at the cameras; may be empty
};

struct LiveCameraSource {
  std::string name;
  std::unique_ptr<capture::FrameSource> source;            // read by a thread of its own
  std::function<std::vector<std::string>()> take_trouble;  // what the user should read; may be empty; thread-safe
};

// Looks at the newest pictures as fast as it can, and keeps those where the board is at rest at a new place. Ends at
// the stop (that is no error), after `seconds`, or when nothing is missing. throws InputError: a camera gave no
// picture, or never saw the board
FoundBoards gather_live(std::vector<LiveCameraSource> cameras, const board::BoardDetector& detector,
                        const LiveBoardsOptions& options, std::stop_token stop);

}  // namespace huetrack::gather
