// The subcommands of huetrack-calibrate. Each adds itself to the program; the one that was asked for sets `chosen`.
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

// What the program ends with, so that scripts can act.
enum class ExitStatus : std::uint8_t {
  usable = 0,
  failed = 1,    // or the command line, an input or an output is at fault: one line on stderr says which
  doubtful = 2,  // there is a result, but the report says what is wrong with it
};

// Does the work; output for people goes to stdout, progress to stderr. A stop ends the looking: live it goes on with
// what there is, otherwise it throws; solving is not interrupted. Throws std::exceptions with one readable line.
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
