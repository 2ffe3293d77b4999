// What a map's file begins with, by which it is known from other files; also where the methods that make maps are not
// built.
#pragma once

#include <filesystem>
#include <string_view>

namespace huetrack::camera_tracking {

inline constexpr std::string_view map_magic = "huetrack camera map 2\n", map_magic_1 = "huetrack camera map 1\n";

// What is there would be replaced by write_map(): a map, or nothing. throws std::runtime_error, naming the file.
void refuse_other_than_map(const std::filesystem::path& file);

}  // namespace huetrack::camera_tracking
