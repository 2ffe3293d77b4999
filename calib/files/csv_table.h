// Reader of CSV files with a header line; columns are found by name. Fields are numbers and plain words. As
// spreadsheets and programs write them: separated by commas, semicolons, tabs or blanks (by the header); a number may
// have a decimal comma, where commas do not separate or the field is in quotes; a header may begin with # (numpy),
// follow a line like sep=; (Excel) and have its names in capitals. Empty lines, blanks around a field and a byte order
// mark are ignored. Size limits: text_file.h.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "calib/files/config_error.h"
#include "calib/files/text_file.h"

namespace huetrack::files {

// Units of times, as suffixes of names, each a thousandth of the one before.
inline constexpr std::array<std::string_view, 4> time_units{"s", "ms", "us", "ns"};
inline constexpr std::array<std::string_view, 4> time_unit_names{"seconds", "milliseconds", "microseconds",
                                                                 "nanoseconds"};

// Index of the unit of a column like t, t_s, time_ms, "Timestamp [us]"; nullopt: not the name of a time.
std::optional<std::size_t> time_unit_of(std::string_view header);

// thread-compatible.
class CsvTable {
 public:
  // columns: header names to read; others are ignored. "target|ball" matches the first of these names that exists;
  // "arrival?" is optional; "@time" is any name of a time (time_unit_of()). throws ConfigError: unreadable, empty, or a
  // column is missing.
  CsvTable(std::filesystem::path file, std::span<const std::string_view> columns);

  bool has(std::size_t column) const { return columns_[column].cell.has_value(); }
  const std::string& name(std::size_t column) const { return columns_[column].name; }  // as the header spells it
  // A last line without a line end is truncated (full disk, crash). After this call next() treats it as the end of the
  // file, and truncated_line() is its number.
  void skip_truncated_row() { skips_truncated_row_ = true; }
  std::optional<int> truncated_line() const { return truncated_line_; }

  // After this call every row must have as many fields as the header: in a file that a program wrote, any other row is
  // damaged.
  void reject_ragged_rows() { rejects_ragged_rows_ = true; }

  bool next();  // to the next row; false at the end. throws ConfigError: too few fields, or a read error
  int line() const { return line_number_; }  // of the current row, from 1
  // Fields of the current row. column: index into the constructor's list; the file must have it. throws ConfigError.
  std::string_view text(std::size_t column) const { return cells_[*columns_[column].cell]; }
  // printable, in quotes, for a message
  std::string quoted(std::size_t column) const { return '"' + printable(text(column)) + '"'; }
  double number(std::size_t column) const;                             // nan and inf are accepted
  std::optional<std::int64_t> whole_number(std::size_t column) const;  // 12, or 1.2e+01; nullopt: it is none
  // In the unit of the column's name, else seconds; exact to the nanosecond. At most some 285 years from zero.
  std::chrono::sys_time<std::chrono::nanoseconds> time(std::size_t column) const;
  [[noreturn]] void fail(const std::string& message) const { throw ConfigError(file_, line_number_, message); }

 private:
  struct Column {
    std::string name;                 // in the header, or the first alternative
    std::optional<std::size_t> cell;  // index in a row; nullopt: not in the header
  };
  bool read_line();  // into cells_; false at the end
  void read_header();
  std::string with_point(std::size_t column) const;
  void require_plain_line() const;
  void refuse_decimal_commas() const;

  std::filesystem::path file_;
  std::ifstream stream_;
  std::vector<Column> columns_;
  std::size_t needed_cells_ = 0;         // minimum for a row
  std::vector<char> buffer_;             // of one line
  std::string_view line_;                // into buffer_
  std::vector<std::string_view> cells_;  // of line_
  char separator_ = ',';
  int line_number_ = 0;
  std::size_t header_cells_ = 0;
  bool skips_truncated_row_ = false;
  bool rejects_ragged_rows_ = false;
  std::optional<int> truncated_line_;
};

}  // namespace huetrack::files
