#include "calib/program/command_line.h"

#include <CLI/CLI.hpp>

#include "calib/files/document_path.h"
#include "calib/files/unknown_words.h"
#include "calib/gather/progress_line.h"

namespace huetrack::program {

std::variant<Command, int> read_command_line(int argc, const char* const* argv) {
  CLI::App app("huetrack-calibrate: calibrates cameras, and judges whether the result can be trusted");
  app.set_version_flag("--version", "huetrack-calibrate " HUETRACK_VERSION);
  app.require_subcommand(1);
  files::name_unknown_words(app, "huetrack-calibrate", CLI::FailureMessage::simple);
  app.footer(
      "Ends with 0 when the result is usable, 2 when it is doubtful (the report says why), 1 when it failed, and above "
      "100 for wrong usage.");

  Command chosen;
  add_intrinsics_command(app, chosen);
  add_extrinsics_command(app, chosen);
  add_world_command(app, chosen);
  add_check_command(app, chosen);
  add_wave_command(app, chosen);
  add_time_command(app, chosen);
  add_certify_command(app, chosen);
  add_map_command(app, chosen);
  add_exchange_commands(app, chosen);
  add_accept_command(app, chosen);
  add_board_command(app, chosen);
  add_coverage_command(app, chosen);
  app.add_flag_callback("--tell-program", &gather::ProgressLine::set_machine_readable,
                        "progress and verdict as lines on standard output, for a program (" +
                            files::document_path("calib/reference.md") + ")");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  }
  return chosen;
}

}  // namespace huetrack::program
