// Which files may be meant by the name of one that is not there.
#pragma once

#include <filesystem>
#include <string>

namespace huetrack::files {

// For the end of an error message: "; in that folder are a.yaml, b.yaml, ...", those with the same extension if there
// are any (folders, if it has none), or "; there is no folder /x". Empty: the folder is empty or cannot be read.
std::string files_beside(const std::filesystem::path& missing);

}  // namespace huetrack::files
