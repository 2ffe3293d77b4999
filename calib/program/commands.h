// The subcommands of huetrack-calibrate. Each adds itself to the program; the selected one sets `chosen`.
//
// To add one: declare it here, define it in NAME_command.cpp, and list it in command_line.cpp.
#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>

namespace CLI {
class App;
}

namespace huetrack::program {

// The exit status, for scripts.
enum class ExitStatus : std::uint8_t {
  usable = 0,
  failed = 1,    // also: wrong command line, input or output; one line on stderr
  doubtful = 2,  // there is a result; the report lists the doubts
};

// Runs the command: results to stdout, progress to stderr. A stop ends the input: a live command continues with what it
// has, others throw; solving is not interrupted. Throws std::exceptions whose what() is one readable line.
using Command = std::function<ExitStatus(std::stop_token stop)>;

void add_intrinsics_command(CLI::App& app, Command& chosen);
void add_extrinsics_command(CLI::App& app, Command& chosen);
void add_world_command(CLI::App& app, Command& chosen);
void add_check_command(CLI::App& app, Command& chosen);
void add_wave_command(CLI::App& app, Command& chosen);
void add_time_command(CLI::App& app, Command& chosen);
void add_certify_command(CLI::App& app, Command& chosen);
void add_map_command(CLI::App& app, Command& chosen);
void add_exchange_commands(CLI::App& app, Command& chosen);  // import and export
void add_accept_command(CLI::App& app, Command& chosen);
void add_board_command(CLI::App& app, Command& chosen);
void add_coverage_command(CLI::App& app, Command& chosen);

}  // namespace huetrack::program
