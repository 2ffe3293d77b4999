// The first bytes of a map file. Built in every configuration, also without the methods that write maps.
#pragma once

#include <filesystem>
#include <string_view>

namespace huetrack::camera_tracking {

inline constexpr std::string_view map_magic = "huetrack camera map 2\n", map_magic_1 = "huetrack camera map 1\n";

// Throws std::runtime_error, naming the file, if write_map() would replace a file that is not a map.
void refuse_other_than_map(const std::filesystem::path& file);

}  // namespace huetrack::camera_tracking
