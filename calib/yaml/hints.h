// What somebody probably meant who wrote a value that is none of the wanted kind, or a line that is no YAML: the end of
// a message that says what to write instead ("write 0.04: a point, not a comma"). Empty where nothing is known. Pure
// functions; thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace huetrack::yaml {

// A number as our files have it, the whole of the text; nullopt: it is none, or not finite.
std::optional<double> parse_number(std::string_view text);

// text: that is no number. key: its name ends with the unit that is wanted (radius_m), or with none.
enum class NumberKind : std::uint8_t { number, whole_number };
std::string number_hint(std::string_view text, std::string_view key, NumberKind wanted = NumberKind::number);

// text: numbers that are no list, as in "640x480", "65-115", "0 0 60 40".
std::string list_hint(std::string_view text, std::size_t min_count, std::size_t max_count);

std::string boolean_hint(std::string_view word);

// Why a parser stopped at `line` (from 1) of a text; where it begins is often earlier.
struct SyntaxHint {
  int line = 0;
  std::string text = {};
};
SyntaxHint syntax_hint(std::string_view yaml, int line);

}  // namespace huetrack::yaml
