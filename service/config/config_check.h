// Checks that involve several keys, or the rig.
#pragma once

#include "calib/yaml/yaml_reader.h"
#include "config/service_config.h"

namespace huetrack::config {

// throws ConfigError if keys contradict each other or the rig. root: source of the configuration, for file and line of
// each key.
void check(const ServiceConfig& config, const yaml::YamlReader& root);

// throws ConfigError if a network camera has settings that such a camera cannot have. at: the camera's part of the
// file. Accepts other cameras.
void check_network_camera(const LiveCameraConfig& camera, calib::ImageSize size, const yaml::YamlReader& at);

}  // namespace huetrack::config
