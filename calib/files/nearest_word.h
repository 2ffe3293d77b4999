// "did you mean ...?"
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace huetrack::files {

std::string to_lower_ascii(std::string_view word);

// The nearest of `words` by edit distance, if it is near enough to be a misspelling. Ignores case. A part of a compound
// name also matches ("hue": hue_deg; "tracking": object_tracking), and so does the beginning of a word ("warn":
// warning).
std::optional<std::string> nearest_word(std::string_view word, std::span<const std::string> words);
// All that are equally near, in the given order, without repetition.
std::vector<std::string> nearest_words(std::string_view word, std::span<const std::string> words);

}  // namespace huetrack::files
