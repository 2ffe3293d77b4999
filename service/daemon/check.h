// The sub-commands that only read files and print to stdout. throw ConfigError and other std::exceptions with one
// readable line.
#pragma once

#include <filesystem>

namespace huetrack::daemon {

// `huetrackd check CONFIG`: prints every key with its value, for a tracker or a camera host.
void check(const std::filesystem::path& config);

// `huetrackd compare TRACKS.csv TRUTH.csv`. clock_offset_s: the tracks' clock minus the truth's.
void compare(const std::filesystem::path& tracks_file, const std::filesystem::path& truth_file, double clock_offset_s);

}  // namespace huetrack::daemon
