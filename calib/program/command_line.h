// The command line of huetrack-calibrate. Hides the argument parser, whose header is heavy.
#pragma once

#include <variant>

#include "calib/program/commands.h"

namespace huetrack::program {

// The command to run; or the exit status after help or version were printed, or an error on stderr (above 100, as for
// huetrackd and huetrack).
std::variant<Command, int> read_command_line(int argc, const char* const* argv);

}  // namespace huetrack::program
