// Suggestions for the end of an error message: what the user probably meant by a value of the wrong type, or by a line
// that is not YAML ("write 0.04: a decimal point, not a comma"). Empty if there is no suggestion. Pure functions;
// thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace huetrack::yaml {

// nullopt: the whole text is not a finite number.
std::optional<double> parse_number(std::string_view text);

// text: not a number. key: its suffix names the unit that is expected (radius_m); without one it is the SI unit
// (square).
enum class NumberKind : std::uint8_t { number, whole_number };
std::string number_hint(std::string_view text, std::string_view key, NumberKind wanted = NumberKind::number);

// text: numbers that are not a YAML list, as in "640x480", "65-115", "0 0 60 40".
std::string list_hint(std::string_view text, std::size_t min_count, std::size_t max_count);

std::string boolean_hint(std::string_view word);

// Why a parser stopped at `line` (from 1) of a text. The cause is often in an earlier line.
struct SyntaxHint {
  int line = 0;
  std::string text = {};
};
SyntaxHint syntax_hint(std::string_view yaml, int line);

}  // namespace huetrack::yaml
