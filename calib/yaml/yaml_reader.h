// Strict reading of YAML files: what every YAML file of ours goes through (rigs, recordings, service configurations,
// boards). A key that nobody asked for, a wrong type or a value out of range is a ConfigError that names file and line:
//   huetrackd.yaml:14: object_tracking.particle_cuont is not a known key (did you mean particle_count?)
// thread-compatible. yaml-cpp does not show through this header.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace huetrack::yaml {

// The user's input is at fault. what() is one readable line "file:line: key.path: what is wrong, what to do".
class ConfigError : public std::runtime_error {
 public:
  ConfigError(const std::filesystem::path& file, int line, const std::string& message);  // line <= 0: whole file
  const std::filesystem::path& file() const noexcept { return file_; }
  int line() const noexcept { return line_; }

 private:
  std::filesystem::path file_;
  int line_;
};

// An interval that a number must lie in; written into the error message. NaN and infinity are never accepted.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool min_is_open = false;  // value > min rather than value >= min
  bool max_is_open = false;
};
inline constexpr Range any_number{};
inline constexpr Range positive{.min = 0, .min_is_open = true};
inline constexpr Range non_negative{.min = 0};

// The keys that lead to a value from the root of a file: {"targets", "ball", "radius_m"}.
using KeyPath = std::vector<std::string>;

// One mapping of a YAML file. Ask for every key that you know, then call finish(): it throws on the first key that
// nobody asked for, with a suggestion from those that were. Every getter throws ConfigError; the ones that take a
// default return it when the key is absent (a key that is present but null is an error).
class YamlReader {
 public:
  static YamlReader file(const std::filesystem::path& path);                 // unreadable or not a mapping: ConfigError
  static YamlReader text(const std::string& yaml, const std::string& name);  // name stands for the file in messages

  // This mapping with another file's read over it, as a JSON merge patch (RFC 7396): mappings are merged key by key,
  // anything else takes the place of what is here, and null takes a key away. A message names the file and line that
  // its value comes from; path() and line() are those of this mapping.
  YamlReader patched_with(const YamlReader& patch) const;
  // What is no mapping, or an empty one, in the order of the file. Ask when finish() has accepted the file: aliases in
  // one that nobody knows may be a circle. Counts as asking for none.
  struct Leaf {
    KeyPath path;
    bool is_null = false;
  };
  std::vector<Leaf> leaves() const;

  // The key of that name: which form the file has. Absent and without a default, or any other: it throws.
  std::int64_t version(std::int64_t only, std::optional<std::int64_t> default_value = std::nullopt) const;

  bool has(std::string_view key) const;         // counts as asked for
  bool is_mapping(std::string_view key) const;  // false when absent; counts as asked for
  bool is_list(std::string_view key) const;     // false when absent; counts as asked for
  double number(std::string_view key, Range range) const;
  double number(std::string_view key, Range range, double default_value) const;
  std::int64_t integer(std::string_view key, Range range) const;
  std::int64_t integer(std::string_view key, Range range, std::int64_t default_value) const;
  bool boolean(std::string_view key) const;
  bool boolean(std::string_view key, bool default_value) const;
  std::string string(std::string_view key) const;  // not empty
  std::string string(std::string_view key, const std::string& default_value) const;
  // One of the given words; the message lists them and suggests the nearest.
  std::string choice(std::string_view key, std::span<const std::string_view> words) const;
  std::string choice(std::string_view key, std::span<const std::string_view> words,
                     const std::string& default_value) const;
  // A list of numbers, min_count to max_count of them.
  std::vector<double> numbers(std::string_view key, std::size_t min_count, std::size_t max_count, Range range) const;
  std::vector<std::vector<double>> rows(std::string_view key, std::size_t row_count, std::size_t column_count) const;
  // At least one row, all of the same length.
  std::vector<std::vector<double>> table(std::string_view key, std::size_t min_columns, std::size_t max_columns) const;
  std::vector<std::string> strings(std::string_view key) const;

  YamlReader map(std::string_view key) const;  // required
  std::optional<YamlReader> optional_map(std::string_view key) const;
  YamlReader map_or_empty(std::string_view key) const;       // absent: no key, at this one's line
  std::vector<YamlReader> maps(std::string_view key) const;  // a list of mappings
  // A mapping whose keys are names of the user's choice (cameras, targets), in the order of the file.
  // A name given twice is an error.
  std::vector<std::pair<std::string, YamlReader>> named_maps(std::string_view key) const;
  std::vector<std::string> keys() const;  // in the order of the file; asks for none

  // Throws on the first unknown key. elsewhere: the keys of other mappings of such a file, of which it may be one.
  void finish(std::span<const KeyPath> elsewhere = {}) const;

  // Throws ConfigError at the key (or, when it is absent, at this mapping): "file:line: path.key: message".
  [[noreturn]] void fail(std::string_view key, const std::string& message) const;
  const std::filesystem::path& path() const;  // of the file
  int line() const;

 private:
  struct Node;
  explicit YamlReader(std::shared_ptr<Node> node);
  std::shared_ptr<Node> node_;
};

}  // namespace huetrack::yaml
