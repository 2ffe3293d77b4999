// Text for people: what printf would print, and lists.
#pragma once

#include <string>
#include <vector>

namespace huetrack::config {

[[gnu::format(printf, 1, 2)]] std::string formatted(const char* pattern, ...);

std::string list_of(const std::vector<std::string>& names);  // "left, right"

// What stays the same of a sentence while its figures change: without digits, points and signs. For comparing only.
std::string without_numbers(std::string text);

}  // namespace huetrack::config
