// A folder of its own under the system's temporary one, deleted with this. thread-compatible.
#pragma once

#include <filesystem>
#include <string>

namespace huetrack::files {

class TemporaryFolder {
 public:
  // name: the beginning of the folder's own. throws std::system_error: it cannot be made
  explicit TemporaryFolder(const std::string& name);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::filesystem::path path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace huetrack::files
