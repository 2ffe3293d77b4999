// The INI file of ROS camera_calibration (ost.ini, ost.txt, and camera_calibration_parsers): under [image] the size,
// under a section per camera its matrices, each a line with its name and lines of numbers. Private to this module.
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "calib/yaml/value_tree.h"

namespace huetrack::exchange {

// With the keys of the camera_info YAML, at the root, or in a mapping per camera if there are several. nullopt: the
// text is of another kind. throws files::ConfigError: a line is neither
std::optional<yaml::Value> ost_ini_of(std::string_view text, const std::filesystem::path& file);

}  // namespace huetrack::exchange
