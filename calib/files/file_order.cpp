#include "calib/files/file_order.h"

#include <glob.h>

#include <algorithm>

namespace huetrack::files {
namespace {

constexpr std::string_view digits = "0123456789";

std::size_t end_of_number(std::string_view text, std::size_t from) {
  return std::min(text.find_first_not_of(digits, from), text.size());
}

bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

// Digits after a point are a fraction in a UNIX time (nine digits: all times since 1973; programs drop trailing zeros),
// and in seconds, as in t0.133s.
bool is_fraction(std::string_view text, std::size_t at) {
  constexpr std::size_t digits_of_unix_time = 9;
  if (at < 2 || text[at - 1] != '.' || digits.find(text[at - 2]) == std::string_view::npos) return false;
  const std::size_t end = end_of_number(text, at);
  const bool is_in_seconds =
      end < text.size() && text[end] == 's' && (end + 1 == text.size() || !is_letter(text[end + 1]));
  if (is_in_seconds) return true;
  if (at < 1 + digits_of_unix_time) return false;
  return text.substr(at - 1 - digits_of_unix_time, digits_of_unix_time).find_first_not_of(digits) ==
         std::string_view::npos;
}

std::string_view without_extension(std::string_view path) {
  const std::size_t point = path.rfind('.'), name = path.rfind('/');
  const bool is_extension = point != std::string_view::npos && (name == std::string_view::npos || point > name) &&
                            point + 1 < path.size() && is_letter(path[point + 1]);
  return is_extension ? path.substr(0, point) : path;
}

}  // namespace

bool numbers_ascend(std::string_view path_a, std::string_view path_b) {
  std::string_view a = without_extension(path_a), b = without_extension(path_b);
  if (a == b) a = path_a, b = path_b;
  std::size_t i = 0, j = 0;
  const auto is_digit = [](std::string_view text, std::size_t at) {
    return at < text.size() && digits.find(text[at]) != std::string_view::npos;
  };
  while (i < a.size() && j < b.size()) {
    if (!is_digit(a, i) || !is_digit(b, j)) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i, ++j;
      continue;
    }
    std::string_view x = a.substr(i, end_of_number(a, i) - i), y = b.substr(j, end_of_number(b, j) - j);
    const bool is_whole = !is_fraction(a, i) || !is_fraction(b, j);
    i += x.size(), j += y.size();
    if (is_whole) {  // leading zeros count nothing
      x.remove_prefix(std::min(x.find_first_not_of('0'), x.size()));
      y.remove_prefix(std::min(y.find_first_not_of('0'), y.size()));
      if (x.size() != y.size()) return x.size() < y.size();
    }
    if (x != y) return x < y;
  }
  const std::size_t rest_a = a.size() - i, rest_b = b.size() - j;
  return rest_a != rest_b ? rest_a < rest_b : a < b;
}

std::vector<std::filesystem::path> files_of_glob(const std::string& pattern) {
  std::vector<std::filesystem::path> found;
  glob_t matches{};
  if (::glob(pattern.c_str(), 0, nullptr, &matches) == 0)
    found.assign(matches.gl_pathv, matches.gl_pathv + matches.gl_pathc);
  ::globfree(&matches);
  std::ranges::sort(found, [](const auto& a, const auto& b) { return numbers_ascend(a.native(), b.native()); });
  return found;
}

}  // namespace huetrack::files
