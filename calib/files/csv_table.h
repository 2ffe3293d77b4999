// The one reader of CSV files: a header line, columns by name. For files of numbers and plain words: no quoting. Empty
// lines, blanks around a field and the byte order mark that spreadsheets write say nothing. Limits: text_file.h.
#pragma once

#include <chrono>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace huetrack::yaml {

// thread-compatible.
class CsvTable {
 public:
  // columns: names from the header. "target|ball" is the first of several names that is there, "arrival?" may be
  // missing. Columns that are not asked for are ignored. throws ConfigError: unreadable, empty, or a column is missing.
  CsvTable(std::filesystem::path file, std::span<const std::string_view> columns);

  bool has(std::size_t column) const { return columns_[column].cell.has_value(); }
  const std::string& name(std::size_t column) const { return columns_[column].name; }  // that the header has for it
  // A last line without its end was not written to its end (a full disk, a crash). From here on next() takes it for the
  // end of the file, and truncated_line() is its number.
  void skip_truncated_row() { leaves_out_cut_off_row_ = true; }
  std::optional<int> truncated_line() const { return cut_off_line_; }

  // From here on a row must have as many cells as the header: a file of a program's, in which any other row is damaged.
  void reject_ragged_rows() { refuses_ragged_rows_ = true; }

  bool next();  // to the next row; false at the end. throws ConfigError: a row with too few columns, reading fails
  int line() const { return line_number_; }  // of the current row, from 1
  // Of the current row; column indexes what the constructor was given, and the file has it. They throw ConfigError
  // "file:line: ...".
  std::string_view text(std::size_t column) const;
  std::string quoted(std::size_t column) const;  // the text, for a message
  double number(std::size_t column) const;       // nan and inf are numbers here
  // Decimal seconds, exact to the nanosecond; further digits are cut off.
  std::chrono::sys_time<std::chrono::nanoseconds> time(std::size_t column) const;
  [[noreturn]] void fail(const std::string& message) const;

 private:
  struct Column {
    std::string name;                 // that the header has, or could have
    std::optional<std::size_t> cell;  // of a row
  };
  bool read_line();  // into cells_; false at the end
  void require_plain_line() const;

  std::filesystem::path file_;
  std::ifstream stream_;
  std::vector<Column> columns_;
  std::size_t needed_cells_ = 0;         // that a row must have
  std::vector<char> buffer_;             // of one line
  std::string_view line_;                // in it
  std::vector<std::string_view> cells_;  // of line_
  int line_number_ = 0;
  std::size_t header_cells_ = 0;
  bool leaves_out_cut_off_row_ = false;
  bool refuses_ragged_rows_ = false;
  std::optional<int> cut_off_line_;
};

}  // namespace huetrack::yaml
