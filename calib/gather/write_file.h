// Files that are there whole or not at all.
#pragma once

#include <filesystem>
#include <string>

namespace huetrack::gather {

// Atomic: by a temporary file beside it. throws std::system_error
void write_file(const std::filesystem::path& file, const std::string& text);

}  // namespace huetrack::gather
