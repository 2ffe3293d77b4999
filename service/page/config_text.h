// The configuration's files as they are, for a user who copies them from the page.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace huetrack::page {

struct ConfigText {
  std::filesystem::path file;
  std::string text;  // without the passwords of network cameras
};

// The configuration, and what was taught to it if that file exists. throws std::runtime_error if a file cannot be read,
// or is longer than a reply may be.
std::vector<ConfigText> config_texts(const std::filesystem::path& config);

// "rtsp://user:secret@host" as "rtsp://***@host", wherever it is.
std::string without_passwords(const std::string& text);

}  // namespace huetrack::page
