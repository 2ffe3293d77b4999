// A film that its camera stored in several files: camcorders (AVCHD: .MTS, .m2ts) begin a new one every 2 or 4 GB.
// Private to this module.
#pragma once

#include <filesystem>
#include <vector>

namespace huetrack::recordings {

// The MPEG transport streams of a folder, or of a glob that matches only such, by their numbers. Empty: frames is
// neither. throws ConfigError: one does not go on where the one before it ends, by their time stamps
std::vector<std::filesystem::path> stream_parts(const std::filesystem::path& frames);

}  // namespace huetrack::recordings
