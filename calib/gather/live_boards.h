// Gathers views of a board from live cameras, with instructions on what is still missing.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "calib/board/board_detector.h"
#include "calib/gather/find_boards.h"
#include "capture/frames/frame_source.h"

namespace huetrack::gather {

struct LiveBoardsOptions {
  std::optional<double> seconds;                              // duration; nullopt: until nothing is missing, or stop
  capture::Duration tolerance = capture::duration_of(0.017);  // within a frame set
  bool until_enough = true;                                   // end when nothing is missing
  bool progress = true;
  std::filesystem::path page;                               // DetectionPage; empty: none
  std::function<void(const std::string& status)> looked{};  // called after every frame set; may be empty
};

struct LiveCameraSource {
  std::string name;
  // Read by its own thread; Frame::camera is the camera's index. nullptr: another camera's source delivers its frames,
  // too
  std::unique_ptr<capture::FrameSource> source;
  std::function<std::vector<std::string>()> take_trouble;  // messages for the user; may be empty; thread-safe
};

// Processes the newest frame set continuously, and keeps views of a resting board at a new place. Ends at the stop (not
// an error), after `seconds`, or when nothing is missing. throws InputError: a camera without images, or without the
// board
FoundBoards gather_live(std::vector<LiveCameraSource> cameras, const board::BoardDetector& detector,
                        const LiveBoardsOptions& options, std::stop_token stop);

}  // namespace huetrack::gather
