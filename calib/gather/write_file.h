// Pages and reports: there whole or not at all.
#pragma once

#include <filesystem>
#include <string>

namespace huetrack::gather {

// Replaces a page or a report, and nothing else. throws std::system_error, std::runtime_error; both name the file
void write_file(const std::filesystem::path& file, const std::string& text);

}  // namespace huetrack::gather
