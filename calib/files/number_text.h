// Numbers from text and to text, exactly; no locale has a say. Pure functions; thread-safe.
#pragma once

#include <array>
#include <charconv>
#include <optional>
#include <string>
#include <string_view>

namespace huetrack::yaml {

// nullopt: the text, all of it, is no number, or none that a Number can hold.
template <typename Number>
std::optional<Number> number_of(std::string_view text) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

// The shortest text that reads back as the same double.
inline void append_shortest(std::string& out, double value) {
  std::array<char, 32> buffer;
  out.append(buffer.data(), std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr);
}
inline std::string shortest_text(double value) {
  std::string out;
  append_shortest(out, value);
  return out;
}

}  // namespace huetrack::yaml
