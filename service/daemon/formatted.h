// Text for people: what printf would print, and lists.
#pragma once

#include <string>
#include <vector>

namespace huetrack {

[[gnu::format(printf, 1, 2)]] std::string formatted(const char* pattern, ...);

std::string list_of(const std::vector<std::string>& names);  // "left, right"

}  // namespace huetrack
