// huetrackd: the service, on live cameras and on recordings.
#include <signal.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <exception>

#include "calib/files/text_file.h"
#include "calib/files/unknown_words.h"
#include "capture/v4l2_source.h"
#include "daemon/commands.h"
#include "daemon/service_manager.h"
#include "daemon/signals.h"

namespace {

using namespace huetrack;

// Returns the status, or exits at once if a thread hangs in a camera's driver.
int end_with(int status) {
  const auto names = capture::abandoned_cameras();
  if (names.empty()) return status;
  for (const auto& name : names) spdlog::warn("camera {}: does not answer; ending without waiting for it", name);
  spdlog::default_logger()->flush();
  std::fflush(nullptr);
  std::_Exit(status);
}

}  // namespace

int main(int argc, char** argv) {
  daemon::Signals::hold();
  daemon::set_up_log();
  signal(SIGXFSZ, SIG_IGN);  // the limit of file sizes is an error message, not the end of the program

  CLI::App app("huetrackd: tracks coloured objects in 3-D with calibrated cameras, and publishes them over DDS");
  app.set_version_flag("--version", "huetrackd " HUETRACK_VERSION);
  app.require_subcommand(1);
  files::name_unknown_words(app, "huetrackd", CLI::FailureMessage::simple);
  daemon::Command chosen;
  daemon::add_setup_command(app, chosen);
  daemon::add_demo_command(app, chosen);
  daemon::add_check_command(app, chosen);
  daemon::add_replay_command(app, chosen);
  daemon::add_run_command(app, chosen);
  daemon::add_capture_command(app, chosen);
  daemon::add_record_command(app, chosen);
  daemon::add_doctor_command(app, chosen);
  daemon::add_compare_command(app, chosen);
  daemon::add_teach_command(app, chosen);
  CLI11_PARSE(app, argc, argv);

  const daemon::Signals signals(std::move(chosen.on_signal));
  int status = 0;
  try {
    status = chosen.run(signals.token());
  } catch (const std::exception& error) {  // errors of input or environment: one line
    std::fprintf(stderr, "%shuetrackd: %s\n", daemon::journal_prefix(),
                 files::printable(error.what(), files::longest_message).c_str());
    return end_with(1);
  }
  if (std::fflush(stdout) != 0) {
    std::fprintf(stderr, "huetrackd: cannot write to standard output\n");
    return end_with(1);
  }
  return end_with(status);
}
