// The exception for faulty user input: configuration, rig, table, recording.
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace huetrack::files {

// what() is one printable line: "file:line: key.path: what is wrong, what to do".
class ConfigError : public std::runtime_error {
 public:
  ConfigError(const std::filesystem::path& file, int line, const std::string& message);  // line <= 0: the whole file
  const std::filesystem::path& file() const noexcept { return file_; }
  int line() const noexcept { return line_; }

 private:
  std::filesystem::path file_;
  int line_;
};

}  // namespace huetrack::files
