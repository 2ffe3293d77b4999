// Requests in words (README.md): names and limits for both ends. The service refuses requests beyond the limits.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>

namespace huetrack::idl {

// Together below the limit of the sample (topics.h).
inline constexpr std::size_t most_control_words = 32, longest_control_word = 200;
inline constexpr std::size_t longest_recording_name = 100;  // fits a tar header

// As in README.md, without those for programs only.
struct ControlGroup {
  std::string_view word, requests;
};
inline constexpr std::array control_groups{
    ControlGroup{"record", "state, start, stop, save, list, delete NAME"},
    ControlGroup{"target", "list, set NAME KEY=VALUE ..., add NAME [KEY=VALUE ...], rename OLD NEW, remove NAME"},
    ControlGroup{"camera", "list, controls NAME, set NAME CONTROL=VALUE ..., save NAME CONTROL=VALUE ..."},
    ControlGroup{"calibrate",
                 "board [KEY=VALUE ...], wave TARGET [SECONDS] [camera_distance=CAMERA,CAMERA,METRES], again "
                 "camera_distance=CAMERA,CAMERA,METRES, state, stop, cancel, accept [doubtful]"},
    ControlGroup{"replay", "open NAME, close, state, pause, go, step [N], speed X, seek SECONDS"}};

// Letters, digits, '.', '_' and '-', not beginning with '.': a plain folder name.
inline bool is_recording_name(std::string_view name) {
  const auto is_allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
           c == '-';
  };
  return !name.empty() && name.size() <= longest_recording_name && name.front() != '.' &&
         std::ranges::all_of(name, is_allowed);
}

}  // namespace huetrack::idl
