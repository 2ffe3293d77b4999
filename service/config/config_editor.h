// Changes a configuration file the way a person would: the lines that are meant, and nothing else. Comments, order and
// spelling of everything else stay. What was written is read back, and must say what was meant, before it takes the
// place of the old file.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/service_config.h"

namespace huetrack::config {

// A value to write: a scalar or list as YAML text, or a mapping.
struct YamlValue {
  std::string text;                                        // where it is no mapping
  std::vector<std::pair<std::string, YamlValue>> entries;  // of a mapping
  bool is_map = false;
  bool removes_others = false;  // entries of the file that are not among these go

  static YamlValue of(std::string text) { return {.text = std::move(text), .entries = {}}; }
  static YamlValue map(std::vector<std::pair<std::string, YamlValue>> entries, bool removes_others = false) {
    return {.text = {}, .entries = std::move(entries), .is_map = true, .removes_others = removes_others};
  }
};

// yaml with the value set at its root, merged into the mappings that are there: block and flow style. Pure.
// throws std::runtime_error where the file's form is beyond this (anchors, a list where a mapping should be): then a
// person has to do it.
std::string with_value(const std::string& yaml, const YamlValue& root);

// Writes a target's colours, and the ignored rectangles when they are given, into config.file. Atomic: the file is the
// old or the new one. throws std::runtime_error, naming the file: it cannot be written, or not be changed in this way;
// what to write by hand is in the message.
void save_taught(const ServiceConfig& config, const object_tracking::TargetOptions& target,
                 const std::optional<object_tracking::IgnoredRegions>& ignored);
void save_ignored(const ServiceConfig& config, const object_tracking::IgnoredRegions& ignored);

}  // namespace huetrack::config
