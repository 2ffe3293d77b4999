// The order of numbered files. Pure functions but for the folder that is read; thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace huetrack::files {

// Numbers in names compare as numbers: img2 before img10, and 1700000000.5 before 1700000000.75, t0.1s before t0.133s.
// Names compare without their extensions: pic.jpg before "pic (1).jpg".
bool numbers_ascend(std::string_view a, std::string_view b);

// The files that match a glob (*, ?, [...]), in that order; empty: none.
std::vector<std::filesystem::path> files_of_glob(const std::string& pattern);

}  // namespace huetrack::files
