// A small picture of a recording, to recognise it in a list.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace huetrack::page {

// The first picture of the recording's first camera that has one, as a JPEG of some kilobytes. Decodes a frame or a
// few. throws ConfigError as recordings::read_recording(), std::runtime_error if no camera has a picture
std::vector<std::uint8_t> recording_picture(const std::filesystem::path& folder);

}  // namespace huetrack::page
