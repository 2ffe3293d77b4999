// Compares sentences while ignoring their figures.
#pragma once

#include <string>

namespace huetrack::pipeline {

// Without digits, points and signs. For comparing only.
inline std::string without_numbers(std::string text) {
  std::erase_if(text, [](char c) { return (c >= '0' && c <= '9') || c == '.' || c == '-'; });
  return text;
}

}  // namespace huetrack::pipeline
