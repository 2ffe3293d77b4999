// Where a document is that a message names: installed, share/doc/huetrack next to the program's folder. Thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace huetrack::files {

// The installed document's absolute path if the program in `bin` has it in ../share/doc/huetrack; otherwise `name`,
// which is relative to the source tree.
std::string document_path(std::string_view name, const std::filesystem::path& bin);

// For the running program.
std::string document_path(std::string_view name);

}  // namespace huetrack::files
