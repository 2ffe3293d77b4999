// Sentences that are to be said once, though their figures change.
#pragma once

#include <string>

namespace huetrack::pipeline {

// What stays the same of a sentence while its figures change: without digits, points and signs. For comparing only.
inline std::string without_numbers(std::string text) {
  std::erase_if(text, [](char c) { return (c >= '0' && c <= '9') || c == '.' || c == '-'; });
  return text;
}

}  // namespace huetrack::pipeline
