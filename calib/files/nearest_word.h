// "did you mean ...?"
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace huetrack::yaml {

// ASCII's alone.
std::string to_lower_ascii(std::string_view word);

// The one of `words` that is nearest to `word` by edit distance, if it is near enough to be a misspelling.
// Small and capital letters are the same here, and half of a name with parts is near to it ("hue" to hue_deg,
// "tracking" to object_tracking), as is the beginning of a longer word ("warn" to warning).
std::optional<std::string> nearest_word(std::string_view word, std::span<const std::string> words);
// All that are equally near, in their order; each once.
std::vector<std::string> nearest_words(std::string_view word, std::span<const std::string> words);

}  // namespace huetrack::yaml
