#include "calib/files/config_error.h"

#include "calib/files/text_file.h"

namespace huetrack::files {
namespace {

constexpr std::size_t longest_path = 200;  // capacity: characters of the path in a message

std::string error_text(const std::filesystem::path& file, int line, const std::string& message) {
  return printable(file.string(), longest_path) + (line > 0 ? ":" + std::to_string(line) : "") + ": " +
         printable(message, longest_message);
}

}  // namespace

ConfigError::ConfigError(const std::filesystem::path& file, int line, const std::string& message)
    : std::runtime_error(error_text(file, line, message)), file_(file), line_(line) {}

}  // namespace huetrack::files
