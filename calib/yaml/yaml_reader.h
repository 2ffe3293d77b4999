// Strict reader for all YAML files (rigs, recordings, service configurations, boards). An unknown key, a wrong type or
// a value out of range is a files::ConfigError with file and line:
//   huetrackd.yaml:14: object_tracking.particle_cuont is not a known key (did you mean particle_count?)
// thread-compatible. yaml-cpp is not visible through this header.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "calib/files/config_error.h"

namespace huetrack::yaml {

// Interval for a number; error messages print it. NaN and infinity are never accepted.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool min_is_open = false;  // value > min instead of value >= min
  bool max_is_open = false;
};
inline constexpr Range any_number{};
inline constexpr Range positive{.min = 0, .min_is_open = true};
inline constexpr Range non_negative{.min = 0};

// Path of keys from the root of a file to a value: {"targets", "ball", "radius_m"}.
using KeyPath = std::vector<std::string>;

// One mapping of a YAML file. Read every known key, then call finish(): it throws on the first key that was never
// requested, and suggests one that was. Every getter throws files::ConfigError. Getters with a default return it if the
// key is absent; a key that is present but null is an error.
class YamlReader {
 public:
  static YamlReader file(const std::filesystem::path& path);                 // throws: unreadable, not a mapping
  static YamlReader text(const std::string& yaml, const std::string& name);  // name: the file name in messages

  // This mapping with `patch` applied as a JSON merge patch (RFC 7396): mappings are merged key by key, any other value
  // replaces, null removes. Messages name the file and line of the value's origin; path() and line() stay this
  // mapping's.
  YamlReader patched_with(const YamlReader& patch) const;
  // All values that are not mappings, and empty mappings, in file order. Does not count as requesting keys. Call it
  // after finish(): aliases in an unchecked file may be circular.
  struct Leaf {
    KeyPath path;
    bool is_null = false;
  };
  std::vector<Leaf> leaves() const;

  // Key `version`, the file format. Throws if it is not `only`, or if it is absent and there is no default.
  std::int64_t version(std::int64_t only, std::optional<std::int64_t> default_value = std::nullopt) const;

  bool has(std::string_view key) const;         // counts as a request
  bool is_mapping(std::string_view key) const;  // false if absent; counts as a request
  bool is_list(std::string_view key) const;     // false if absent; counts as a request
  double number(std::string_view key, Range range) const;
  double number(std::string_view key, Range range, double default_value) const {
    return has(key) ? number(key, range) : default_value;
  }
  std::int64_t integer(std::string_view key, Range range) const;
  std::int64_t integer(std::string_view key, Range range, std::int64_t default_value) const {
    return has(key) ? integer(key, range) : default_value;
  }
  bool boolean(std::string_view key) const;
  bool boolean(std::string_view key, bool default_value) const { return has(key) ? boolean(key) : default_value; }
  std::string string(std::string_view key) const;  // not empty
  std::string string(std::string_view key, const std::string& default_value) const {
    return has(key) ? string(key) : default_value;
  }
  // One of `words`; the error message lists them and suggests the nearest.
  std::string choice(std::string_view key, std::span<const std::string_view> words) const;
  std::string choice(std::string_view key, std::span<const std::string_view> words,
                     const std::string& default_value) const {
    return has(key) ? choice(key, words) : default_value;
  }
  // A list of min_count to max_count numbers.
  std::vector<double> numbers(std::string_view key, std::size_t min_count, std::size_t max_count, Range range) const;
  std::vector<std::vector<double>> rows(std::string_view key, std::size_t row_count, std::size_t column_count) const;
  // At least one row, all of the same length.
  std::vector<std::vector<double>> table(std::string_view key, std::size_t min_columns, std::size_t max_columns) const;
  std::vector<std::string> strings(std::string_view key) const;

  YamlReader map(std::string_view key) const;  // required
  std::optional<YamlReader> optional_map(std::string_view key) const;
  YamlReader map_or_empty(std::string_view key) const;       // absent: an empty mapping at this line
  std::vector<YamlReader> maps(std::string_view key) const;  // a list of mappings
  // A mapping whose keys are the user's names (cameras, targets), in file order.
  std::vector<std::pair<std::string, YamlReader>> named_maps(std::string_view key) const;
  std::vector<std::string> keys() const;  // in file order; does not count as a request

  // Throws on the first unknown key. elsewhere: keys of other mappings of this file format, for the suggestion.
  void finish(std::span<const KeyPath> elsewhere = {}) const;

  // Throws "file:line: path.key: message"; the line is the key's, or this mapping's if the key is absent.
  [[noreturn]] void fail(std::string_view key, const std::string& message) const;
  const std::filesystem::path& path() const;  // of the file
  int line() const;

 private:
  struct Node;
  explicit YamlReader(std::shared_ptr<Node> node);
  std::shared_ptr<Node> node_;
};

}  // namespace huetrack::yaml
