// What both ends of a request in words (README.md) hold it to: the service refuses the rest, clients do not send it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>

namespace huetrack::idl {

// More than any request has; the sample's own limit (topics.h) is above what these make.
inline constexpr std::size_t most_control_words = 32, longest_control_word = 200;
inline constexpr std::size_t longest_recording_name = 100;  // what a tar's header has room for

// Letters, digits, '.', '_' and '-', not beginning with '.': what can be a folder's name and nothing else.
inline bool is_recording_name(std::string_view name) {
  const auto is_allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
           c == '-';
  };
  return !name.empty() && name.size() <= longest_recording_name && name.front() != '.' &&
         std::ranges::all_of(name, is_allowed);
}

}  // namespace huetrack::idl
