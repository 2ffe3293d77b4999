// The sub-commands of huetrackd. Each adds itself to the program; the selected one sets `chosen`.
//
// To add one: declare it here, define it in commands.cpp (the only user of the argument parser besides main()), and
// list it in main.cpp.
#pragma once

#include <functional>
#include <stop_token>

#include "daemon/signals.h"

namespace CLI {
class App;
}

namespace huetrack::daemon {

struct Command {
  // Returns the exit status. throws std::exceptions with one readable line.
  std::function<int(const std::stop_token& stop)> run;
  Signals::Others on_signal = {};  // handlers of signals other than SIGINT and SIGTERM
};

void add_check_command(CLI::App& app, Command& chosen);
void add_replay_command(CLI::App& app, Command& chosen);
void add_run_command(CLI::App& app, Command& chosen);
void add_setup_command(CLI::App& app, Command& chosen);
void add_demo_command(CLI::App& app, Command& chosen);
void add_capture_command(CLI::App& app, Command& chosen);
void add_record_command(CLI::App& app, Command& chosen);
void add_doctor_command(CLI::App& app, Command& chosen);
void add_compare_command(CLI::App& app, Command& chosen);
void add_teach_command(CLI::App& app, Command& chosen);

}  // namespace huetrack::daemon
