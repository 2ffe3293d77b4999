// Options shared by subcommands. Private to this module.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calib/files/document_path.h"
#include "calib/gather/gather_boards.h"
#include "calib/program/outcome.h"
#include "calib/solver/extrinsics.h"

namespace huetrack::program {

struct CalibrationOptions {
  std::string board;
  std::vector<std::string> inputs;
  gather::FindBoardsOptions find;
  std::optional<solver::LensModel> lens;
  std::string rig, report;
  gather::LiveOptions live;
  bool overwrite = false, quiet = false;
  std::optional<double> temperature_c;
};

inline void add_calibration_options(CLI::App& command, CalibrationOptions& options) {
  command.add_option("inputs", options.inputs, "recordings, videos or images of the board");
  command.add_option("--live", options.live.file,
                     "use the live cameras of this file (its map cameras: as in huetrackd.yaml)");
  command
      .add_option_function<std::string>(
          "--size",
          [&options](const std::string& text) {
            calib::ImageSize size;
            char end = 0;
            if (std::sscanf(text.c_str(), "%dx%d%c", &size.width, &size.height, &end) != 2 || size.width < 1 ||
                size.height < 1)
              throw CLI::ValidationError("--size", "give it as 640x480");
            options.live.settings.size = size;
          },
          "live: the size of the images")
      ->type_name("WIDTHxHEIGHT");
  command.add_option("--fps", options.live.settings.fps, "live: frames per second")->check(CLI::PositiveNumber);
  command.add_option("--seconds", options.live.seconds, "live: duration; default: until nothing is missing, or Ctrl-C")
      ->check(CLI::PositiveNumber);
  command.add_option("--view", options.live.page,
                     "write a page for a browser with the detections and what is still missing");
  command.add_option("--board", options.board, "the board file; see " + files::document_path("calib/README.md"))
      ->required();
  const std::map<std::string, solver::LensModel> lenses{{"radtan4", solver::LensModel::radtan4},
                                                        {"radtan5", solver::LensModel::radtan5},
                                                        {"radtan8", solver::LensModel::radtan8},
                                                        {"fisheye", solver::LensModel::fisheye},
                                                        {"stereographic", solver::LensModel::stereographic}};
  command
      .add_option("--lens", options.lens,
                  "the lens model; default: the one with the most evidence, an ordinary one if none is clearly better")
      ->transform(CLI::CheckedTransformer(lenses).description(""))
      ->type_name("radtan4|radtan5|radtan8|fisheye|stereographic");
  command.add_option("--every", options.find.every, "process every n-th frame set; default: about 800")
      ->check(CLI::PositiveNumber);
  command
      .add_option("--max-sets", options.find.max_sets,
                  "use at most this many frame sets, with the board as still as possible")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command.add_option("--report", options.report, "the report (HTML, and a text file of the same name)");
  command.add_option("--temperature", options.temperature_c, "of the room, degrees Celsius; saved in the rig file")
      ->check(CLI::Range(-90.0, 150.0));
  command.add_flag("--overwrite", options.overwrite, "a doubtful result may replace an existing rig");
  command.add_flag("--quiet", options.quiet, "print nothing but errors");
}

inline OutputFiles output_files(const CalibrationOptions& options) {
  OutputFiles files;
  files.rig = options.rig;
  files.report = options.report.empty() ? std::filesystem::path(options.rig).replace_extension(".report.html")
                                        : page_name(options.report);
  files.report_was_named = !options.report.empty();
  files.overwrite = options.overwrite;
  files.quiet = options.quiet;
  files.temperature_c = options.temperature_c;
  return files;
}

}  // namespace huetrack::program
