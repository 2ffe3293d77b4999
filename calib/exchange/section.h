// One mapping of another tool's file, in whatever syntax: YAML, JSON, TOML or OpenCV's XML. Private to this module.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "calib/exchange/exchanged_camera.h"
#include "calib/yaml/value_tree.h"

namespace huetrack::exchange {

using Words = std::span<const std::string_view>;

// The documents of a file, by its syntax. throws files::ConfigError
std::vector<yaml::Value> documents_of(const std::filesystem::path& file);

// Strict in values, not in keys: left_out() lists the keys that were never asked for. May be a union of mappings, of
// which the first that has a key answers; each remembers what it was asked for. Getters throw files::ConfigError at the
// key's line.
class Section {
 public:
  Section(const yaml::Value& map, std::filesystem::path file, std::string path = {});
  static Section joined(std::span<const Section> parts);

  bool has(std::string_view key) const { return find(key) != nullptr; }  // and is not null
  // The first of the words, each with `suffix` or _suffix, that is a key here.
  std::optional<std::string> first_of(Words words, std::string_view suffix = {}) const;
  std::vector<double> numbers(std::string_view key) const;  // of nested lists and {rows, cols, data}, row by row
  double number(std::string_view key) const;
  bool is_text(std::string_view key) const;
  std::string text(std::string_view key) const;
  std::vector<std::string> texts(std::string_view key) const;  // a list
  bool boolean(std::string_view key) const;                    // true, false, 1 or 0
  std::optional<Section> map(std::string_view key) const;      // nullopt: absent, or no map
  // Its maps, and those in its lists (named by their index), in file order. Not asked for by this.
  std::vector<std::pair<std::string, Section>> maps() const;
  std::vector<std::string> keys() const;
  std::vector<std::string> left_out() const;
  void ignore(std::string_view key) const;  // counts as asked for

  [[noreturn]] void fail(std::string_view key, const std::string& message) const;
  Fail failing() const {
    return [this](std::string_view key, const std::string& message) { fail(key, message); };
  }
  const std::filesystem::path& file() const { return parts_.front().file; }
  const std::string& path() const { return parts_.front().path; }
  int line() const { return parts_.front().map->line; }

 private:
  struct Part {
    const yaml::Value* map;  // of the caller's documents
    std::filesystem::path file;
    std::string path;  // dotted
    std::shared_ptr<std::set<std::string, std::less<>>> asked;
  };
  Section() = default;
  const yaml::Value* find(std::string_view key) const;
  const yaml::Value& value(std::string_view key) const;

  std::vector<Part> parts_;
};

}  // namespace huetrack::exchange
