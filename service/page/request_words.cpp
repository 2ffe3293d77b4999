#include "page/request_words.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

namespace huetrack::page {
namespace {

template <typename Number>
std::optional<Number> parsed(std::string_view text) {
  Number number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc{} && end == text.data() + text.size() ? std::optional(number) : std::nullopt;
}

}  // namespace

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
  const auto number = parsed<double>(text);
  return number && std::isfinite(*number) ? number : std::nullopt;
}

double real_of(std::string_view text) {
  if (const auto number = finite_number(text)) return *number;
  throw std::runtime_error(fmt::format("a number is wanted, not {}", text));
}

std::uint64_t whole_number_of(std::string_view text) {
  if (const auto number = parsed<std::uint64_t>(text)) return *number;
  throw std::runtime_error(fmt::format("a whole number is wanted, not {}", text));
}

std::runtime_error unknown_request() {
  return std::runtime_error("this service does not know that request");
}

}  // namespace huetrack::page
