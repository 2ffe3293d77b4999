// The command line of huetrack-calibrate: of the program and its tests only this sees the argument parser, whose header
// is heavy.
#pragma once

#include <variant>

#include "calib/program/commands.h"

namespace huetrack::program {

// The command that the words ask for, not done yet; or the status that the program ends with, because all is said:
// help, the version, or on stderr what is wrong with the words (above 100, as of huetrackd and huetrack).
std::variant<Command, int> read_command_line(int argc, const char* const* argv);

}  // namespace huetrack::program
