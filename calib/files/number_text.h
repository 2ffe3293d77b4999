// Numbers from and to text, exact and independent of the locale. Pure functions; thread-safe.
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>

namespace huetrack::files {

// nullopt: the whole text is not a number, or does not fit a Number.
template <typename Number>
std::optional<Number> number_of(std::string_view text) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

inline bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

// "ball_3" is one of several objects of "ball".
inline bool is_object_of(std::string_view name, std::string_view target) {
  if (!name.starts_with(target) || name.size() < target.size() + 2 || name[target.size()] != '_') return false;
  return std::ranges::all_of(name.substr(target.size() + 1), is_digit);
}

// A number, or a ratio of two as programs write frame rates (30000/1001); a leading + is accepted.
inline std::optional<double> ratio_of(std::string_view text) {
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  const auto slash = text.find('/');
  if (slash == std::string_view::npos) return number_of<double>(text);
  const auto above = number_of<double>(text.substr(0, slash)), below = number_of<double>(text.substr(slash + 1));
  return above && below && *below > 0 ? std::optional(*above / *below) : std::nullopt;
}

// The shortest text that parses to the same double.
inline void append_shortest(std::string& out, double value) {
  std::array<char, 32> buffer;
  out.append(buffer.data(), std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr);
}
inline std::string shortest_text(double value) {
  std::string out;
  append_shortest(out, value);
  return out;
}

// Seconds with nine decimals; CsvTable::time() reads them back exactly.
inline std::string seconds_text(std::int64_t nanoseconds) {
  std::string text = std::to_string(std::abs(nanoseconds));
  if (text.size() < 10) text.insert(0, 10 - text.size(), '0');  // at least 0.000000000
  text.insert(text.size() - 9, 1, '.');
  return nanoseconds < 0 ? '-' + text : text;
}

}  // namespace huetrack::files
