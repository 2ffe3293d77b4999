// The sub-commands that look at files and run nothing. What they find goes to stdout. throw ConfigError and other
// std::exceptions of one readable line.
#pragma once

#include <filesystem>

namespace huetrack::daemon {

// `huetrackd check CONFIG`: the configuration resolved, every key, default or given; of a tracker or a camera host.
void check(const std::filesystem::path& config);

// `huetrackd compare TRACKS.csv TRUTH.csv`. clock_offset_s: how far the tracks' clock is ahead of the truth's.
void compare(const std::filesystem::path& tracks_file, const std::filesystem::path& truth_file, double clock_offset_s);

}  // namespace huetrack::daemon
