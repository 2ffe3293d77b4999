#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "calib/board/board_yaml.h"
#include "calib/files/document_path.h"
#include "calib/gather/find_boards.h"
#include "calib/gather/progress_line.h"
#include "calib/model/rig_yaml.h"
#include "calib/program/commands.h"
#include "calib/program/outcome.h"
#include "calib/program/rig_pictures.h"
#include "calib/report/rig_check_report.h"
#include "calib/solver/rig_check.h"

namespace huetrack::program {
namespace {

struct CheckOptions {
  std::string rig, board, mend;
  std::vector<std::string> inputs;
  gather::FindBoardsOptions find{.max_sets = 60, .page = {}};
  bool note = false, quiet = false;
};

// Prints the rig file's history and lack of uncertainty.
void print_history(const calib::CameraRig& rig) {
  if (const std::string age = rig.made.text(utc_now()); !age.empty()) std::printf("The rig: %s.\n", age.c_str());
  if (!rig.uncertainty)
    std::printf(
        "It has no uncertainty: its cameras are taken as exact, and covariances of positions lack the error of the "
        "calibration.\n");
}

ExitStatus check(const CheckOptions& options, const std::stop_token& stop) {
  const board::Board board = board::read_board(options.board);
  calib::CameraRig rig = calib::read_rig(options.rig);
  if (!options.quiet) print_history(rig);
  gather::FindBoardsOptions find = options.find;
  find.progress = !options.quiet;
  const gather::FoundBoards found = board_views_of(rig, options.rig, board, options.inputs, find, stop);
  gather::ProgressLine line(!options.quiet);
  const solver::RigCheck result = solver::check_rig(found.board, rig, found.views, line.progress());
  const report::RigCheckReport report = report::report_on(result, rig, found.board_doubt);
  line.clear();
  if (!options.quiet) std::fputs(report::to_text(report, result).c_str(), stdout);
  if (options.note) {
    rig.made.add({utc_now(), std::string(report::name(report.verdict)), report.checks.front().finding});
    calib::write_rig(rig, options.rig);
  }
  if (!options.mend.empty()) {
    for (const solver::MovedCamera& moved : result.moved) {
      rig.cameras[static_cast<std::size_t>(moved.camera)].cam_from_world = moved.cam_from_world;
      if (rig.uncertainty) rig.uncertainty = calib::with_pose_covariance(rig, moved.camera, moved.covariance);
    }
    note_in(rig, "mended",
            result.moved.empty() ? "nothing had moved" : "by huetrack-calibrate check, from views of the board");
    calib::write_rig(rig, options.mend);
    if (!options.quiet) std::printf("written: %s\n", options.mend.c_str());
  }
  return status_of(report.verdict);
}

}  // namespace

void add_check_command(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<CheckOptions>();
  CLI::App* command = app.add_subcommand("check", "test whether a rig still fits; names a camera that was moved");
  command->add_option("rig", options->rig, "the rig file")->required();
  command->add_option("inputs", options->inputs, "a recording of the board, or NAME=FRAMES for each camera")
      ->required();
  command->add_option("--board", options->board, "the board file; see " + files::document_path("calib/README.md"))
      ->required();
  command->add_option("--mend", options->mend, "write the rig with the new poses of moved cameras");
  command->add_flag("--note", options->note, "save the verdict and its time in the rig file");
  command->add_option("--every", options->find.every, "process every n-th frame set")->check(CLI::PositiveNumber);
  command->add_flag("--quiet", options->quiet, "print nothing but errors");
  command->callback(
      [options, &chosen] { chosen = [options](const std::stop_token& stop) { return check(*options, stop); }; });
}

}  // namespace huetrack::program
