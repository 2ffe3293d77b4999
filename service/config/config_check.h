// What one key of a configuration alone cannot tell.
#pragma once

#include "calib/yaml/yaml_reader.h"
#include "config/service_config.h"

namespace huetrack::config {

// throws ConfigError: keys contradict each other or the rig. root: what the configuration was read from; it knows the
// file and line of each key.
void check(const ServiceConfig& config, const yaml::YamlReader& root);

}  // namespace huetrack::config
