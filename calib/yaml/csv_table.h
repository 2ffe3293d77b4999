// Reading CSV files with a header line, columns by name. For small files of numbers and plain words: no quoting.
#pragma once

#include <chrono>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace huetrack::yaml {

// thread-compatible.
class CsvTable {
 public:
  // Columns that are not asked for are ignored. throws ConfigError: unreadable, or a column is missing.
  CsvTable(std::filesystem::path file, std::span<const std::string_view> columns);

  bool next();  // to the next row; false at the end
  // Of the current row; column indexes what the constructor was given. They throw ConfigError "file:line: ...".
  std::string_view text(std::size_t column) const;
  double number(std::size_t column) const;  // nan and inf are numbers here
  std::chrono::sys_time<std::chrono::nanoseconds> time(
      std::size_t column) const;  // decimal seconds, exact to the nanosecond
  [[noreturn]] void fail(const std::string& message) const;

 private:
  std::filesystem::path file_;
  std::ifstream stream_;
  std::vector<std::string> names_;
  std::vector<std::size_t> position_;  // in the file, of each column that was asked for
  std::string line_;
  std::vector<std::string_view> cells_;  // of line_
  int line_number_ = 1;
};

}  // namespace huetrack::yaml
