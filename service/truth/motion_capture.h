// Ground truth as motion-capture systems export it. Private to this module.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "truth/truth.h"

namespace huetrack::truth {

using Samples = std::map<std::string, std::vector<Truth::Sample>, std::less<>>;  // by name, by time

// By the file's first line: CSV of Motive (OptiTrack; markers and rigid bodies), CSV of Vicon Nexus and Tracker
// (Trajectories; Objects, Segments), TSV of Qualisys (3D), or TUM (one body without a name). Positions in metres, axes
// as in the file; times from the first frame of Vicon and Qualisys. Rows in which a marker was not seen are left out.
// nullopt: another file. throws files::ConfigError
std::optional<Samples> read_motion_capture(const std::filesystem::path& file);

}  // namespace huetrack::truth
