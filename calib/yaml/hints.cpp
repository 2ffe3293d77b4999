#include "calib/yaml/hints.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "calib/files/nearest_word.h"
#include "calib/files/number_text.h"
#include "calib/files/text_file.h"

namespace huetrack::yaml {
namespace {

constexpr std::string_view indents = " \t";

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(indents);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

using files::is_digit;
bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}

// Length of the plain decimal number at the beginning of `text`; 0: none.
std::size_t length_of_number(std::string_view text) {
  std::size_t at = !text.empty() && (text.front() == '-' || text.front() == '+') ? 1 : 0;
  const std::size_t first = at;
  while (at < text.size() && is_digit(text[at])) ++at;
  if (at < text.size() && text[at] == '.') {
    std::size_t end = at + 1;
    while (end < text.size() && is_digit(text[end])) ++end;
    if (end > at + 1) at = end;
  }
  return at > first ? at : 0;
}

struct Unit {
  std::string_view written, key_suffix, name;
  double factor;
};
constexpr std::array<Unit, 16> units{{{"m", "_m", "metres", 1},
                                      {"cm", "_m", "metres", 0.01},
                                      {"mm", "_m", "metres", 0.001},
                                      {"s", "_s", "seconds", 1},
                                      {"sec", "_s", "seconds", 1},
                                      {"ms", "_s", "seconds", 1e-3},
                                      {"us", "_s", "seconds", 1e-6},
                                      {"deg", "_deg", "degrees", 1},
                                      {"degrees", "_deg", "degrees", 1},
                                      {"\u00b0", "_deg", "degrees", 1},
                                      {"px", "_px", "pixels", 1},
                                      {"hz", "_hz", "hertz", 1},
                                      {"hz", "fps", "frames per second", 1},
                                      {"fps", "fps", "frames per second", 1},
                                      {"m/s", "_m_s", "metres per second", 1},
                                      {"mb", "_mb", "megabytes", 1}}};

// The units of a key: those of its suffix. A key without a suffix (square, marker, translation) has SI units, except
// the lens parameters, which are in pixels.
bool has_unit_of(std::string_view key, const Unit& unit) {
  constexpr std::array<std::string_view, 4> lens_keys{"fx", "fy", "cx", "cy"};
  if (key.ends_with(unit.key_suffix)) return true;
  if (std::ranges::find(lens_keys, key) != lens_keys.end()) return false;
  const bool is_si = unit.key_suffix == "_m" || unit.key_suffix == "_s" || unit.key_suffix == "_m_s";
  return is_si && std::ranges::none_of(units, [&](const Unit& other) { return key.ends_with(other.key_suffix); });
}

std::string without_unit(std::string_view number, std::string_view unit, std::string_view key) {
  const auto value = parse_number(number);
  if (!value) return {};
  if (unit == "%") return fmt::format("write {:.6g}: a share, without the unit", *value / 100);
  const std::string small = files::to_lower_ascii(unit);
  for (const Unit& known : units)
    if (known.written == small && has_unit_of(key, known))
      return fmt::format("write {:.6g}: {}, without the unit", *value * known.factor, known.name);
  const bool is_word = unit.front() != 'x' && std::ranges::all_of(unit, is_letter);  // 0x is not a unit
  return is_word ? fmt::format("write {}, the number alone", number) : std::string();
}

std::vector<std::string_view> lines_of(std::string_view text) {
  std::vector<std::string_view> lines;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    lines.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return lines;
}

// Blanks out quoted text, which is not YAML, and cuts the comment. Positions stay.
std::string without_texts(std::string_view line) {
  std::string out(line);
  char quote = 0;
  for (std::size_t at = 0; at < out.size(); ++at) {
    const char c = out[at];
    if (quote != 0) {
      if (c == quote) quote = 0;
      out[at] = 'x';
    } else if (c == '#' && (at == 0 || indents.find(out[at - 1]) != std::string_view::npos)) {
      out.resize(at);
    } else if ((c == '"' || c == '\'') && (at == 0 || !is_letter(out[at - 1]))) {
      quote = c;
      out[at] = 'x';
    }
  }
  return out;
}

std::size_t indentation_of(std::string_view line) {
  return std::min(line.find_first_not_of(' '), line.size());
}

// The key-like word at the beginning of `content`.
std::string_view word_of(std::string_view content) {
  const auto end =
      std::ranges::find_if(content, [](char c) { return !is_letter(c) && !is_digit(c) && c != '-' && c != '/'; });
  return content.substr(0, std::size_t(end - content.begin()));
}

std::string hint_of_line(std::string_view whole) {
  const std::string bare = without_texts(whole);
  std::string_view content = trimmed(bare);
  const bool is_of_list = content.starts_with("- ");
  if (is_of_list) content = trimmed(content.substr(2));
  if (content.empty() || content.front() == '{' || content.front() == '[') return {};
  const std::string_view word = word_of(content);
  const std::string_view rest = content.substr(word.size());
  const std::string_view value = trimmed(rest.empty() ? rest : rest.substr(1));
  if (word.empty()) return {};
  const std::string key = files::printable(word);
  if (trimmed(rest).empty()) return is_of_list ? "" : fmt::format("a colon is missing after {0}: write {0}:", key);
  if (trimmed(rest).starts_with('=') && trimmed(rest).size() > 1)
    return fmt::format("write {}: {}, with a colon", key, files::printable(trimmed(trimmed(rest).substr(1))));
  if (rest.front() != ':') return {};
  if (rest.size() > 1 && indents.find(rest[1]) == std::string_view::npos && !rest.substr(1).starts_with("//"))
    return fmt::format("a space is missing after the colon: write {}: {}", key, files::printable(value));
  if (!value.empty() && std::string_view("@`%").find(value.front()) != std::string_view::npos)
    return fmt::format("put quotation marks around what begins with {0}: write {1}: \"{2}\"", value.front(), key,
                       files::printable(value));
  const std::string_view inner = word_of(value);
  if (!inner.empty() && value.substr(inner.size()).starts_with(": "))
    return fmt::format("one line has one key: write {}: {{{}}}, or {} on a line of its own, indented further", key,
                       files::printable(value), files::printable(inner));
  return {};
}

// The innermost bracket that is never closed.
SyntaxHint open_bracket(const std::vector<std::string_view>& lines) {
  struct Open {
    char bracket;
    int line;
  };
  std::vector<Open> open;
  for (std::size_t n = 0; n < lines.size(); ++n) {
    for (const char c : without_texts(lines[n])) {
      if (c == '[' || c == '{') open.push_back({c, int(n) + 1});
      if ((c == ']' || c == '}') && !open.empty()) open.pop_back();
    }
  }
  if (open.empty()) return {};
  const char closing = open.back().bracket == '[' ? ']' : '}';
  return {open.back().line, fmt::format("{} is never closed: write {} where it ends", open.back().bracket, closing)};
}

// The first line whose indentation fits no open mapping.
SyntaxHint odd_indentation(const std::vector<std::string_view>& lines, int line) {
  const std::size_t last = std::min(std::size_t(line), lines.size());
  std::vector<std::size_t> levels;  // of the open mappings
  for (std::size_t n = 0; n < last; ++n) {
    const std::string bare = without_texts(lines[n]);
    if (trimmed(bare).empty()) continue;
    const std::size_t here = indentation_of(bare);
    if (levels.empty() || here > levels.back()) {
      // Indented under a line that already has a value.
      if (!levels.empty() && n > 0 && n + 1 == last && !trimmed(without_texts(lines[n - 1])).ends_with(':'))
        return {int(n) + 1, fmt::format("it is indented by {} spaces, but the line above it by {}: keys that belong "
                                        "together need the same indentation",
                                        here, levels.back())};
      levels.push_back(here);
      continue;
    }
    while (!levels.empty() && levels.back() > here) levels.pop_back();
    if (levels.empty() || levels.back() != here)
      return {int(n) + 1,
              fmt::format("it is indented by {} spaces, like no line above it: keys that belong together need the "
                          "same indentation",
                          here)};
  }
  return {};
}

}  // namespace

std::optional<double> parse_number(std::string_view text) {
  const auto value = files::ratio_of(text);
  return value && std::isfinite(*value) ? value : std::nullopt;
}

std::string number_hint(std::string_view given, std::string_view key, NumberKind wanted) {
  const std::string_view text = trimmed(given);
  if (const auto value = parse_number(text)) {
    // Beyond 2^53 a double is not exact.
    if (wanted == NumberKind::whole_number && (*value != std::trunc(*value) || std::abs(*value) > 0x1p53)) return {};
    return fmt::format("write {}, without quotation marks", text);
  }
  std::string with_point(text);
  const std::size_t comma = text.find(',');
  const bool has_comma = comma != std::string_view::npos && text.find_first_of(",.", comma + 1) == std::string::npos &&
                         text.find('.') == std::string::npos;
  constexpr std::size_t digits_of_a_thousand = 3;
  if (has_comma && wanted == NumberKind::whole_number) {
    with_point.erase(comma, 1);
    const bool is_plain = std::ranges::all_of(with_point, is_digit) && text.size() == comma + 1 + digits_of_a_thousand;
    return is_plain ? fmt::format("write {}, without the comma", with_point) : std::string();
  }
  if (has_comma) with_point[comma] = '.';
  const std::size_t length = length_of_number(with_point);
  if (length == 0) return {};
  const std::string number = with_point.substr(0, length);
  const std::string_view unit = trimmed(std::string_view(with_point).substr(length));
  if (!unit.empty()) return without_unit(number, unit, key);
  return has_comma ? fmt::format("write {}: a decimal point, not a comma", number) : std::string();
}

std::string list_hint(std::string_view text, std::size_t min_count, std::size_t max_count) {
  std::vector<std::string> numbers;
  while (!text.empty()) {
    const std::size_t length = length_of_number(text);
    if (length == 0) {
      if (is_letter(text.front()) && text.front() != 'x' && text.front() != 'X' && !text.starts_with("to ")) return {};
      text.remove_prefix(text.starts_with("to ") ? 3 : 1);
      continue;
    }
    numbers.emplace_back(text.substr(0, length));
    text.remove_prefix(length);
    // Between two numbers it is a separator, not a sign.
    if (text.starts_with('-') || text.starts_with('+')) text.remove_prefix(1);
    while (text.starts_with('.')) text.remove_prefix(1);
  }
  if (numbers.empty() || numbers.size() < min_count || numbers.size() > max_count) return {};
  return fmt::format("write [{}]", fmt::join(numbers, ", "));
}

std::string boolean_hint(std::string_view given) {
  const std::string word = files::to_lower_ascii(given);
  constexpr std::array<std::string_view, 5> yes{"true", "yes", "on", "y", "1"}, no{"false", "no", "off", "n", "0"};
  const bool is_yes = std::ranges::find(yes, word) != yes.end();
  if (!is_yes && std::ranges::find(no, word) == no.end()) return {};
  const bool is_quoted = word == "true" || word == "false";
  return fmt::format("write {}{}", is_yes ? "true" : "false", is_quoted ? ", without quotation marks" : "");
}

SyntaxHint syntax_hint(std::string_view yaml, int line) {
  const std::vector<std::string_view> lines = lines_of(yaml);
  const int last = std::clamp(line, 1, int(lines.size()));
  for (int n = 1; n <= last; ++n) {
    const std::string_view text = lines[std::size_t(n - 1)];
    const std::size_t begin = text.find_first_not_of(indents);
    if (begin == std::string_view::npos || text[begin] == '#') continue;
    if (text.substr(0, begin).find('\t') != std::string_view::npos)
      return {n, "its indentation has a tab: write spaces, two for each level"};
    if (text.substr(begin).starts_with("\u00a0"))
      return {n, "its indentation has no-break spaces, as copied from a web page: write plain spaces"};
  }
  // The parser stops at the faulty line or at the next one.
  int above = last - 1;
  while (above > 0 && trimmed(without_texts(lines[std::size_t(above - 1)])).empty()) --above;
  for (const int n : {above, last}) {
    if (n < 1) continue;
    if (std::string hint = hint_of_line(lines[std::size_t(n - 1)]); !hint.empty()) return {n, std::move(hint)};
  }
  if (SyntaxHint open = open_bracket(lines); !open.text.empty()) return open;
  return odd_indentation(lines, last);
}

}  // namespace huetrack::yaml
