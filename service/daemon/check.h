// The sub-commands that only read files and print to stdout. throw ConfigError and other std::exceptions with one
// readable line.
#pragma once

#include <filesystem>

#include "truth/alignment.h"

namespace huetrack::daemon {

// `huetrackd check CONFIG`: prints every key with its value, for a tracker or a camera host.
void check(const std::filesystem::path& config);

struct CompareCommand {
  std::filesystem::path tracks, truth;
  double clock_offset_s = 0;                    // the tracks' clock minus the truth's
  truth::Freedom align = truth::Freedom::none;  // of all targets together, before they are compared
  bool align_time = false;
};

// `huetrackd compare TRACKS.csv TRUTH.csv`
void compare(const CompareCommand& command);

}  // namespace huetrack::daemon
