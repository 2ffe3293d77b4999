// Joins words for a message.
#pragma once

#include <string>
#include <string_view>
#include <utility>

namespace huetrack::files {

// "left, right, top"; words: texts or paths.
std::string joined(const auto& words, std::string_view between = ", ") {
  std::string text;
  bool is_first = true;
  for (const auto& word : words) {
    if (!std::exchange(is_first, false)) text += between;
    text += std::string(word);
  }
  return text;
}

}  // namespace huetrack::files
