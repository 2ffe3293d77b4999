#include "page/request_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/files/number_text.h"
#include "idl/control_words.h"

namespace huetrack::page {
std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> parts;
  for (;;) {
    const std::size_t end = text.find(separator);
    parts.emplace_back(text.substr(0, end));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

std::optional<double> finite_number(std::string_view text) {
  const auto number = files::number_of<double>(text);
  return number && std::isfinite(*number) ? number : std::nullopt;
}

double real_of(std::string_view text) {
  if (const auto number = finite_number(text)) return *number;
  throw std::runtime_error(fmt::format("write a number, not {}", text));
}

std::uint64_t whole_number_of(std::string_view text) {
  if (const auto number = files::number_of<std::uint64_t>(text)) return *number;
  throw std::runtime_error(fmt::format("write a whole number, not {}", text));
}

UnknownRequest unknown_request() {
  return UnknownRequest("this service does not know that request");
}

std::string known_requests(std::span<const std::string> words) {
  const auto& groups = idl::control_groups;
  const auto* group = words.empty() ? groups.end() : std::ranges::find(groups, words[0], &idl::ControlGroup::word);
  if (group != groups.end()) return fmt::format("after {} it knows {}", group->word, group->requests);
  std::string all;
  for (const idl::ControlGroup& known : groups) all += fmt::format("{}, ", known.word);
  return "known requests begin with " + all + "undo, redo, history";
}

}  // namespace huetrack::page
