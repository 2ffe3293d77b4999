#include "calib/files/nearest_word.h"

#include <algorithm>

namespace huetrack::files {
namespace {

// Optimal string alignment: insertions, deletions, replacements and swaps of neighbours, each at cost 1.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1), previous(b.size() + 1), current(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) previous[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    current[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      current[j] = std::min(
          {previous[j] + 1, current[j - 1] + 1, previous[j - 1] + static_cast<std::size_t>(a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        current[j] = std::min(current[j], before[j - 2] + 1);
      }
    }
    std::swap(before, previous);
    std::swap(previous, current);
  }
  return previous[b.size()];
}

}  // namespace

std::string to_lower_ascii(std::string_view word) {
  std::string out(word);
  for (char& c : out)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return out;
}

std::vector<std::string> nearest_words(std::string_view given, std::span<const std::string> words) {
  const std::string word = to_lower_ascii(given);
  std::vector<std::string> nearest;
  const auto add = [&nearest](const std::string& candidate) {
    if (std::ranges::find(nearest, candidate) == nearest.end()) nearest.push_back(candidate);
  };
  std::size_t smallest = word.size() / 3;  // one error in three letters is a misspelling, more is another word
  for (const std::string& candidate : words) {
    if (candidate.size() > 2 * word.size() + 2 || word.size() > 2 * candidate.size() + 2) continue;
    const std::size_t distance = edit_distance(word, to_lower_ascii(candidate));
    if (distance > smallest) continue;
    if (distance < smallest) nearest.clear();
    smallest = distance;
    add(candidate);
  }
  if (!nearest.empty()) return nearest;
  constexpr std::size_t shortest_part = 3, shortest_beginning = 4;
  const auto is_half = [](std::string_view whole, std::string_view part) {
    if (part.size() < shortest_part || whole.size() <= part.size()) return false;
    if (whole.starts_with(part)) return whole[part.size()] == '_' || part.size() >= shortest_beginning;
    return whole.ends_with(part) && whole[whole.size() - part.size() - 1] == '_';
  };
  for (const std::string& candidate : words) {
    const std::string small = to_lower_ascii(candidate);
    if (is_half(small, word) || is_half(word, small)) add(candidate);
  }
  return nearest;
}

std::optional<std::string> nearest_word(std::string_view word, std::span<const std::string> words) {
  const auto nearest = nearest_words(word, words);
  return nearest.empty() ? std::nullopt : std::optional(nearest.front());
}

}  // namespace huetrack::files
