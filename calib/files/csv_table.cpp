#include "calib/files/csv_table.h"

#include <fmt/format.h>

#include <algorithm>

#include "calib/files/config_error.h"
#include "calib/files/number_text.h"
#include "calib/files/text_file.h"

namespace huetrack::files {
namespace {

std::string_view without_blanks(std::string_view text) {
  constexpr std::string_view blanks = " \t\r";
  text.remove_prefix(std::min(text.find_first_not_of(blanks), text.size()));
  text.remove_suffix(text.size() - std::min(text.find_last_not_of(blanks) + 1, text.size()));
  return text;
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (;;) {
    const auto end = text.find(separator);
    parts.push_back(without_blanks(text.substr(0, end)));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

}  // namespace

CsvTable::CsvTable(std::filesystem::path file, std::span<const std::string_view> columns)
    : file_(std::move(file)), stream_(open_text_file(file_)), buffer_(longest_line + 1) {
  if (!read_line()) throw ConfigError(file_, 0, "is empty: a header line is needed");
  require_plain_line();
  if (constexpr std::string_view mark = "\xEF\xBB\xBF"; cells_.front().starts_with(mark))
    cells_.front().remove_prefix(mark.size());
  header_cells_ = cells_.size();
  for (std::string_view asked : columns) {
    const bool may_be_missing = asked.ends_with('?');
    if (may_be_missing) asked.remove_suffix(1);
    const std::vector<std::string_view> names = split(asked, '|');
    Column& column = columns_.emplace_back(Column{std::string(names.front()), {}});
    const auto known = std::ranges::find_if(
        names, [&](std::string_view name) { return std::ranges::find(cells_, name) != cells_.end(); });
    if (known != names.end()) {
      column.name = *known;
      column.cell = static_cast<std::size_t>(std::ranges::find(cells_, *known) - cells_.begin());
      needed_cells_ = std::max(needed_cells_, *column.cell + 1);
    } else if (!may_be_missing) {
      fail(fmt::format("the header has no column {}", fmt::join(names, " or ")));
    }
  }
}

bool CsvTable::read_line() {
  stream_.getline(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
  const auto count = static_cast<std::size_t>(stream_.gcount());  // including the line end, if any
  if (stream_.bad()) throw ConfigError(file_, line_number_, "cannot be read beyond this line");
  if (stream_.fail() && (stream_.eof() || count == 0)) return false;
  ++line_number_;
  if (stream_.fail())
    fail("is longer than " + std::to_string(longest_line >> 10U) + " KiB: this is not a huetrack table");
  line_ = {buffer_.data(), stream_.eof() ? count : count - 1};
  while (line_.ends_with('\r')) line_.remove_suffix(1);
  cells_ = split(line_, ',');
  return true;
}

void CsvTable::require_plain_line() const {
  if (has_control_characters(line_)) fail("has control characters in it: this is not a huetrack table");
}

bool CsvTable::next() {
  do {
    if (!read_line()) return false;
    if (skips_truncated_row_ && stream_.eof() && !line_.empty()) {
      truncated_line_ = line_number_;
      return false;
    }
  } while (cells_.size() == 1 && cells_.front().empty());
  require_plain_line();
  if (rejects_ragged_rows_ && cells_.size() != header_cells_)
    fail("has " + std::to_string(cells_.size()) + " fields, but the header has " + std::to_string(header_cells_));
  if (cells_.size() < needed_cells_)
    fail("has " + std::to_string(cells_.size()) + " columns, at least " + std::to_string(needed_cells_) +
         " are needed");
  return true;
}

std::string_view CsvTable::text(std::size_t column) const {
  return cells_[*columns_[column].cell];
}

std::string CsvTable::quoted(std::size_t column) const {
  return '"' + printable(text(column)) + '"';
}

double CsvTable::number(std::size_t column) const {
  const auto value = number_of<double>(text(column));
  if (!value) fail(columns_[column].name + " must be a number, got " + quoted(column));
  return *value;
}

std::chrono::sys_time<std::chrono::nanoseconds> CsvTable::time(std::size_t column) const {
  // A double cannot hold seconds since 1970 with nanoseconds.
  std::string_view rest = text(column);
  const bool negative = rest.starts_with('-');
  if (negative) rest.remove_prefix(1);
  const auto point = std::min(rest.find('.'), rest.size());
  const auto whole = number_of<std::int64_t>(rest.substr(0, point));
  std::string digits(point < rest.size() ? rest.substr(point + 1, 9) : std::string_view());
  digits.resize(9, '0');
  const auto fraction = number_of<std::int64_t>(digits);
  if (!whole || *whole < 0 || *whole > 9'000'000'000 || !fraction || *fraction < 0) {
    fail(columns_[column].name + " must be a time in seconds, got " + quoted(column));
  }
  const std::chrono::nanoseconds since_zero = std::chrono::seconds(*whole) + std::chrono::nanoseconds(*fraction);
  return std::chrono::sys_time<std::chrono::nanoseconds>(negative ? -since_zero : since_zero);
}

void CsvTable::fail(const std::string& message) const {
  throw ConfigError(file_, line_number_, message);
}

}  // namespace huetrack::files
