#include "calib/files/document_path.h"

#include <system_error>

namespace huetrack::files {

namespace fs = std::filesystem;

std::string document_path(std::string_view name, const fs::path& bin) {
  const fs::path installed = bin.parent_path() / "share/doc/huetrack" / name;
  std::error_code none;
  return fs::exists(installed, none) ? installed.string() : std::string(name);
}

std::string document_path(std::string_view name) {
  std::error_code none;
  return document_path(name, fs::read_symlink("/proc/self/exe", none).parent_path());
}

}  // namespace huetrack::files
