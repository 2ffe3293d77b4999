// The values of a file of another tool, as a tree, for readers that must accept keys that they do not know. Our own
// files are read with the strict YamlReader. Pure values.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace huetrack::yaml {

struct Value {
  enum class Kind { null, text, list, map };
  Kind kind = Kind::null;
  std::string text{};               // of a scalar, as written
  std::vector<std::string> keys{};  // of a map, one per item; in file order
  std::vector<Value> items{};       // of a list or a map
  int line = 0;

  const Value* find(std::string_view key) const;  // of a map; null: absent
};

// All documents of a YAML text; JSON, too, which is YAML, and OpenCV's YAML with its "%YAML:1.0". No aliases, so that
// a small file cannot make a large tree. throws files::ConfigError
std::vector<Value> values_of(std::string yaml, const std::filesystem::path& file);

}  // namespace huetrack::yaml
