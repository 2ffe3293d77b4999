#include "calib/files/csv_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "calib/files/nearest_word.h"
#include "calib/files/number_text.h"

namespace huetrack::files {
namespace {

std::string_view without_blanks(std::string_view text) {
  constexpr std::string_view blanks = " \t\r";
  text.remove_prefix(std::min(text.find_first_not_of(blanks), text.size()));
  text.remove_suffix(text.size() - std::min(text.find_last_not_of(blanks) + 1, text.size()));
  return text;
}

std::string_view without_quotes(std::string_view field) {
  const bool is_quoted = field.size() >= 2 && field.front() == '"' && field.back() == '"';
  return is_quoted ? field.substr(1, field.size() - 2) : field;
}

// Behind a field in quotes that begins here; 0: none does, or it does not end.
std::size_t end_of_quotes(std::string_view text) {
  const auto begin = text.find_first_not_of(" \t");
  if (begin == std::string_view::npos || text[begin] != '"') return 0;
  for (auto end = text.find('"', begin + 1); end != std::string_view::npos; end = text.find('"', end + 2))
    if (end + 1 == text.size() || text[end + 1] != '"') return end + 1;  // two are a quote in the field
  return 0;
}

// separator ' ': any number of blanks.
std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (;;) {
    if (separator == ' ') text = without_blanks(text);
    const auto from = end_of_quotes(text);
    const auto end = separator == ' ' ? text.find_first_of(" \t", from) : text.find(separator, from);
    parts.push_back(without_quotes(without_blanks(text.substr(0, end))));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

// Index of the header of this name; of one in capitals, or small letters, only where none is written alike.
std::optional<std::size_t> cell_of(std::span<const std::string_view> headers, std::string_view name) {
  const auto index_if = [&](const auto& is_it) -> std::optional<std::size_t> {
    const auto found = std::ranges::find_if(headers, is_it);
    return found == headers.end() ? std::nullopt : std::optional(std::size_t(found - headers.begin()));
  };
  if (name == "@time") return index_if([](std::string_view header) { return time_unit_of(header).has_value(); });
  if (const auto same = index_if([&](std::string_view header) { return header == name; })) return same;
  return index_if([&](std::string_view header) { return to_lower_ascii(header) == to_lower_ascii(name); });
}

// Of a column as asked for, "a|b": the cell of the first name that the header has.
std::optional<std::size_t> first_cell_of(std::span<const std::string_view> headers, std::string_view asked) {
  for (const std::string_view name : split(asked, '|'))
    if (const auto cell = cell_of(headers, name)) return cell;
  return std::nullopt;
}

bool has_columns(std::span<const std::string_view> headers, std::span<const std::string_view> columns) {
  return std::ranges::all_of(columns, [&](std::string_view asked) {
    return asked.ends_with('?') || first_cell_of(headers, asked).has_value();
  });
}

}  // namespace

std::optional<std::size_t> time_unit_of(std::string_view header) {
  static constexpr std::string_view names[] = {"t", "time", "timestamp"}, between = " _([";
  std::string name = to_lower_ascii(header);
  while (name.ends_with(')') || name.ends_with(']')) name.pop_back();
  const std::size_t base = std::min(name.find_first_of(between), name.size());
  if (std::ranges::find(names, name.substr(0, base)) == std::end(names)) return std::nullopt;
  if (base == name.size()) return 0;
  const std::string unit = name.substr(std::min(name.find_first_not_of(between, base), name.size()));
  const auto known = std::ranges::find(time_units, unit);
  return known == time_units.end() ? std::nullopt : std::optional(std::size_t(known - time_units.begin()));
}

CsvTable::CsvTable(std::filesystem::path file, std::span<const std::string_view> columns)
    : file_(std::move(file)), stream_(open_text_file(file_)), buffer_(longest_line + 1) {
  read_header();
  std::string comment;  // numpy writes the header as one; others write some before it
  while (line_.data() > buffer_.data() && line_.data()[-1] == '#' && !has_columns(cells_, columns)) {
    if (line_.starts_with(" timestamp format") || line_.starts_with(" timecode format"))
      fail("is mkvmerge's list of time stamps: write the header frame,t_ms, and number its lines from 0");
    comment = printable(fmt::format("{}", fmt::join(cells_, ", ")), 200);
    read_header();
  }
  if (!comment.empty() && number_of<double>(cells_.front()))
    fail("has no header line; that of the comment lacks columns: it has " + comment);
  for (std::string_view asked : columns) {
    const bool may_be_missing = asked.ends_with('?');
    if (may_be_missing) asked.remove_suffix(1);
    Column& column =
        columns_.emplace_back(Column{std::string(split(asked, '|').front()), first_cell_of(cells_, asked)});
    if (column.cell) {
      column.name = cells_[*column.cell];
      needed_cells_ = std::max(needed_cells_, *column.cell + 1);
    }
    if (column.cell || may_be_missing) continue;
    fail(fmt::format("the header has no column {}: it has {}",
                     fmt::join(split(asked.substr(0, asked.find("|@")), '|'), " or "),
                     printable(fmt::format("{}", fmt::join(cells_, ", ")), 200)));
  }
}

void CsvTable::read_header() {
  if (!read_line()) throw ConfigError(file_, 0, "is empty: a header line is needed");
  if (line_.starts_with("\xFF\xFE") || line_.starts_with("\xFE\xFF")) fail("is UTF-16: save it as CSV in UTF-8");
  require_plain_line();
  constexpr std::string_view mark = "\xEF\xBB\xBF", names_separator = "sep=";
  if (line_.starts_with(mark)) line_.remove_prefix(mark.size());
  const bool is_named = line_.starts_with(names_separator) && line_.size() == names_separator.size() + 1;
  if (is_named) {
    separator_ = line_.back();
    if (!read_line()) fail("is empty: a header line is needed");
    require_plain_line();
  } else {
    for (const char separator : {',', ';', '\t', ' '})
      if (line_.find(separator) != std::string_view::npos) {
        separator_ = separator;
        break;
      }
  }
  if (line_.starts_with('#')) line_.remove_prefix(1);
  cells_ = split(line_, separator_);
  header_cells_ = cells_.size();
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
  cells_ = split(line_, separator_);
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
  } while (std::ranges::all_of(cells_, &std::string_view::empty));  // spreadsheets write commas alone
  require_plain_line();
  refuse_decimal_commas();
  if (rejects_ragged_rows_ && cells_.size() != header_cells_)
    fail("has " + std::to_string(cells_.size()) + " fields, but the header has " + std::to_string(header_cells_));
  if (cells_.size() < needed_cells_)
    fail("has " + std::to_string(cells_.size()) + " columns, at least " + std::to_string(needed_cells_) +
         " are needed");
  return true;
}

// "0,0,033" under "frame,t_s": each number with a decimal comma looks like two fields.
void CsvTable::refuse_decimal_commas() const {
  const auto is_whole = [](std::string_view cell) { return number_of<std::int64_t>(cell).has_value(); };
  if (separator_ != ',' || cells_.size() <= header_cells_ || !std::ranges::all_of(cells_, is_whole)) return;
  fail(
      fmt::format("has {} fields, but the header has {}: its numbers seem to have decimal commas, which also separate "
                  "the fields: separate them by semicolons, or write decimal points",
                  cells_.size(), header_cells_));
}

// Where commas separate fields, one in a field stands in quotes. std::from_chars knows no +.
std::string CsvTable::with_point(std::size_t column) const {
  std::string number(text(column));
  if (number.starts_with('+') && !number.starts_with("+-")) number.erase(0, 1);
  if (std::ranges::count(number, ',') == 1) number[number.find(',')] = '.';
  return number;
}

double CsvTable::number(std::size_t column) const {
  const auto value = number_of<double>(with_point(column));
  if (!value) fail(columns_[column].name + " must be a number, got " + quoted(column));
  return *value;
}

std::optional<std::int64_t> CsvTable::whole_number(std::size_t column) const {
  if (const auto value = number_of<std::int64_t>(text(column))) return value;
  const auto real = number_of<double>(with_point(column));
  constexpr double exact = 0x1p53;  // doubles beyond skip whole numbers
  if (!real || *real != std::trunc(*real) || std::abs(*real) > exact) return std::nullopt;
  return static_cast<std::int64_t>(*real);
}

std::chrono::sys_time<std::chrono::nanoseconds> CsvTable::time(std::size_t column) const {
  constexpr long double longest_s = 9e9L;  // in 64 bits of nanoseconds
  const std::size_t unit = time_unit_of(columns_[column].name).value_or(0);
  const long double per_second = std::pow(1000.0L, static_cast<long double>(unit));
  // A double cannot hold seconds since 1970 with nanoseconds.
  const auto value = number_of<long double>(with_point(column));
  if (value && std::fabs(*value / per_second) <= longest_s)
    return std::chrono::sys_time<std::chrono::nanoseconds>(
        std::chrono::nanoseconds(std::llround(*value * (1e9L / per_second))));
  std::string hint;
  for (std::size_t finer = unit + 1; value && finer < time_units.size(); ++finer)
    if (hint.empty() && std::fabs(*value) / std::pow(1000.0L, static_cast<long double>(finer)) <= longest_s)
      hint = fmt::format(": if these are {}, name the column t_{}", time_unit_names[finer], time_units[finer]);
  fail(fmt::format("{} must be a time in {}, got {}{}", columns_[column].name, time_unit_names[unit], quoted(column),
                   hint));
}

}  // namespace huetrack::files
