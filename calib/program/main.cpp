// huetrack-calibrate: calibrates cameras, and says whether to trust the result.
#include <pthread.h>
#include <signal.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <stop_token>
#include <thread>

#include "calib/gather/progress_line.h"
#include "calib/program/commands.h"
#include "calib/yaml/text_file.h"
#include "calib/yaml/unknown_command.h"

namespace {

using namespace huetrack;

// SIGINT and SIGTERM become a stop request, taken by a thread that waits for them: nothing runs inside a signal
// handler. The second one ends the program at once. Create it before any other thread.
class Signals {
 public:
  Signals() {
    sigemptyset(&signals_);
    sigaddset(&signals_, SIGINT);
    sigaddset(&signals_, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
    thread_ = std::jthread([this](const std::stop_token& end) {
      while (!end.stop_requested()) {
        const timespec patience{.tv_sec = 0, .tv_nsec = 50'000'000};
        const int signal = sigtimedwait(&signals_, nullptr, &patience);
        if (signal >= 0 && !stop_.request_stop()) std::_Exit(128 + signal);
      }
    });
  }
  std::stop_token token() const { return stop_.get_token(); }

 private:
  sigset_t signals_{};
  std::stop_source stop_;
  std::jthread thread_;
};

}  // namespace

int main(int argc, char** argv) {
  const Signals signals;  // first of all: whoever ends it early is answered, too
  CLI::App app("huetrack-calibrate: calibrates cameras, and says whether to trust the result");
  app.set_version_flag("--version", "huetrack-calibrate " HUETRACK_VERSION);
  app.require_subcommand(1);
  yaml::name_unknown_commands(app, "huetrack-calibrate", CLI::FailureMessage::simple);
  app.footer("Ends with 0 when the result is usable, 2 when it is doubtful (the report says why), 1 when it failed.");

  program::Command chosen;
  program::add_intrinsics_command(app, chosen);
  program::add_extrinsics_command(app, chosen);
  program::add_world_command(app, chosen);
  program::add_check_command(app, chosen);
  program::add_wave_command(app, chosen);
  program::add_time_command(app, chosen);
  program::add_certify_command(app, chosen);
  program::add_map_command(app, chosen);
  program::add_exchange_commands(app, chosen);
  program::add_accept_command(app, chosen);
  program::add_board_command(app, chosen);
  program::add_coverage_command(app, chosen);
  app.add_flag_callback("--tell-program", &gather::ProgressLine::tell_programs,
                        "progress and verdict as lines on standard output, for a program (calib/reference.md)");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 1;
  }
  program::ExitStatus status = program::ExitStatus::failed;
  try {
    status = chosen(signals.token());
  } catch (const std::exception& error) {  // the user's input or the outside world: said once, in one line, here
    std::fprintf(stderr, "huetrack-calibrate: %s\n", yaml::printable(error.what(), yaml::longest_message).c_str());
    return 1;
  }
  if (std::fflush(stdout) != 0) {
    std::fprintf(stderr, "huetrack-calibrate: cannot write to standard output\n");
    return 1;
  }
  return static_cast<int>(status);
}
