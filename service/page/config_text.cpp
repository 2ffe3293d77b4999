#include "page/config_text.h"

#include <fmt/format.h>

#include <fstream>
#include <iterator>
#include <stdexcept>

#include "config/service_config.h"

namespace huetrack::page {
namespace {

constexpr std::size_t most_bytes = 128 * 1024;  // half of the largest reply (control_handler.cpp, piece_bytes)

std::string read(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(in), {});
  if (!in) throw std::runtime_error("cannot read " + file.string());
  if (text.size() > most_bytes)
    throw std::runtime_error(fmt::format("{} is longer than {} bytes: copy it on its host", file.string(), most_bytes));
  return text;
}

}  // namespace

std::string without_passwords(const std::string& text) {
  std::string safe;
  std::size_t done = 0;
  for (std::size_t at = text.find("://"); at != std::string::npos; at = text.find("://", at + 1)) {
    const std::size_t user = at + 3, end = text.find_first_of("@/\"' \t\r\n", user);
    if (end == std::string::npos || text[end] != '@') continue;
    safe.append(text, done, user - done).append("***");
    done = end;
  }
  return safe.append(text, done);
}

std::vector<ConfigText> config_texts(const std::filesystem::path& config) {
  std::vector<ConfigText> texts{{config, without_passwords(read(config))}};
  const std::filesystem::path taught = config::taught_file(config);
  if (std::filesystem::exists(taught)) texts.push_back({taught, without_passwords(read(taught))});
  return texts;
}

}  // namespace huetrack::page
