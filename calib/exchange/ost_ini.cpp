#include "calib/exchange/ost_ini.h"

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "calib/files/config_error.h"

namespace huetrack::exchange {
namespace {

using yaml::Value;
using Kind = Value::Kind;

// Theirs, and the camera_info YAML's.
constexpr std::array<std::pair<std::string_view, std::string_view>, 6> names{{{"camera matrix", "camera_matrix"},
                                                                              {"distortion", "distortion_coefficients"},
                                                                              {"rectification", "rectification_matrix"},
                                                                              {"projection", "projection_matrix"},
                                                                              {"width", "image_width"},
                                                                              {"height", "image_height"}}};

constexpr std::string_view blanks = " \t\r";

void add(Value& map, std::string_view key, Value item) {
  map.keys.emplace_back(key);
  map.items.push_back(std::move(item));
}

std::string_view trimmed(std::string_view line) {
  const std::size_t begin = std::min(line.find_first_not_of(blanks), line.size());
  return line.substr(begin, line.find_last_not_of(blanks) + 1 - begin);
}

}  // namespace

std::optional<Value> ost_ini_of(std::string_view text, const std::filesystem::path& file) {
  if (text.find("[image]") == std::string_view::npos || text.find("camera matrix") == std::string_view::npos)
    return std::nullopt;
  Value size{.kind = Kind::map}, cameras{.kind = Kind::map};
  Value* section = nullptr;
  int number = 0;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    const std::string_view line = trimmed(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    ++number;
    if (line.empty() || line.front() == '#' || line.front() == ';') continue;
    if (line.front() == '[') {
      const std::string_view name = line.substr(1, line.find(']') - 1);
      if (name == "image") {
        section = &(size = {.kind = Kind::map, .line = number});
        continue;
      }
      Value camera{.kind = Kind::map, .keys = size.keys, .items = size.items, .line = number};
      add(camera, "camera_name", {.kind = Kind::text, .text = std::string(name), .line = number});
      add(cameras, name, std::move(camera));
      section = &cameras.items.back();
      continue;
    }
    if (section == nullptr) throw files::ConfigError(file, number, "is before the first section, as [image]");
    if (line.find_first_not_of("+-.0123456789eE \t") != std::string_view::npos) {
      const auto known = std::ranges::find(names, line, &std::pair<std::string_view, std::string_view>::first);
      add(*section, known == names.end() ? line : known->second, {.kind = Kind::list, .line = number});
      continue;
    }
    if (section->items.empty() || section->items.back().kind != Kind::list)
      throw files::ConfigError(file, number, "has numbers without a name above them");
    for (std::size_t at = 0; at < line.size();) {
      const std::size_t to = std::min(line.find_first_of(blanks, at), line.size());
      section->items.back().items.push_back(
          {.kind = Kind::text, .text = std::string(line.substr(at, to - at)), .line = number});
      at = std::min(line.find_first_not_of(blanks, to), line.size());
    }
  }
  if (cameras.items.size() == 1) return std::move(cameras.items.front());
  return cameras;
}

}  // namespace huetrack::exchange
