// What one key of a configuration alone cannot tell.
#pragma once

#include "calib/yaml/yaml_reader.h"
#include "config/service_config.h"

namespace huetrack::config {

// throws ConfigError: keys contradict each other or the rig. root: what the configuration was read from; it knows the
// file and line of each key.
void check(const ServiceConfig& config, const yaml::YamlReader& root);

// throws ConfigError: of a camera that is reached by an address, what such a camera cannot have. at: the camera's part
// of the file. Says nothing of others.
void check_network_camera(const LiveCameraConfig& camera, calib::ImageSize size, const yaml::YamlReader& at);

}  // namespace huetrack::config
