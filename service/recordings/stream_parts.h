// A film that its camera stored in several files: camcorders (AVCHD: .MTS, .m2ts) begin a new one every 2 or 4 GB.
// Private to this module.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace huetrack::recordings {

// Parts of one film that cannot be read as such: chapters of action cameras (.MP4), clocks that begin anew.
inline constexpr const char* how_to_join =
    "join them: ffmpeg -f concat -safe 0 -i LIST -c copy OUT.mp4, where LIST has a line file 'NAME' for each";

// The MPEG transport streams of a folder, or of a glob that matches only such, by their numbers. Empty: frames is
// neither. What is missing between them is a warning. throws ConfigError: one does not go on where the one before it
// ends, by their time stamps
std::vector<std::filesystem::path> stream_parts(const std::filesystem::path& frames,
                                                std::vector<std::string>& warnings);

}  // namespace huetrack::recordings
