#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "calib/solver/board_yaml.h"
#include "calib/solver/intrinsics.h"
#include "calib/tool/commands.h"
#include "calib/tool/find_boards.h"

namespace huetrack {
namespace {

struct Options {
  std::string board, camera, rig;
  std::vector<std::string> inputs;
  FindBoardsOptions find;
  bool quiet = false;
};

ExitStatus calibrate(const Options& options, const std::stop_token& stop) {
  const Board board = read_board(options.board);
  const auto source = open_pictures_of(options.camera, options.inputs);
  const FoundBoards found = find_boards(*source, BoardDetector(board), options.find, stop);
  const Intrinsics result = calibrate_intrinsics(board, options.camera, found.cameras.front().image_size, found.views);
  std::printf("%s: rms %.3f px; %s\n", options.camera.c_str(), result.adjustment.rms_px, result.lens_reason.c_str());
  return ExitStatus::usable;
}

}  // namespace

void add_intrinsics_command(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("intrinsics", "find the lens of one camera from pictures of a board");
  command->add_option("inputs", options->inputs, "images, a video, a folder of images or a recording")->required();
  command->add_option("--board", options->board, "the board file (calib/README.md)")->required();
  command->add_option("--camera", options->camera, "the camera's name")->required();
  command->callback(
      [options, &chosen] { chosen = [options](const std::stop_token& stop) { return calibrate(*options, stop); }; });
}

}  // namespace huetrack
