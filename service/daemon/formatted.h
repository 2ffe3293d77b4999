// What printf would print, as text.
#pragma once

#include <string>

namespace huetrack {

[[gnu::format(printf, 1, 2)]] std::string formatted(const char* pattern, ...);

}  // namespace huetrack
