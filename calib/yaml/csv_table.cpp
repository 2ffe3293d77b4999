#include "calib/yaml/csv_table.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <optional>
#include <system_error>

#include "calib/yaml/yaml_reader.h"

namespace huetrack::yaml {
namespace {

std::vector<std::string_view> split(std::string_view line) {
  if (line.ends_with('\r')) line.remove_suffix(1);
  std::vector<std::string_view> cells;
  for (;;) {
    const auto comma = line.find(',');
    cells.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

template <typename T>
std::optional<T> parsed(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

CsvTable::CsvTable(std::filesystem::path file, std::span<const std::string_view> columns)
    : file_(std::move(file)), stream_(file_), names_(columns.begin(), columns.end()) {
  if (!stream_) throw ConfigError(file_, 0, "cannot be read: " + std::generic_category().message(errno));
  if (!std::getline(stream_, line_)) throw ConfigError(file_, 0, "is empty: a header line is needed");
  cells_ = split(line_);
  for (const auto& name : names_) {
    const auto it = std::ranges::find(cells_, name);
    if (it == cells_.end()) fail("the header has no column " + name);
    position_.push_back(static_cast<std::size_t>(it - cells_.begin()));
  }
}

bool CsvTable::next() {
  do {
    if (!std::getline(stream_, line_)) return false;
    ++line_number_;
  } while (line_.empty() || line_ == "\r");
  cells_ = split(line_);
  if (const auto needed = std::ranges::max(position_); cells_.size() <= needed) {
    fail("has " + std::to_string(cells_.size()) + " columns, at least " + std::to_string(needed + 1) + " are needed");
  }
  return true;
}

std::string_view CsvTable::text(std::size_t column) const {
  return cells_[position_[column]];
}

double CsvTable::number(std::size_t column) const {
  const auto value = parsed<double>(text(column));
  if (!value) fail(names_[column] + " must be a number, got \"" + std::string(text(column)) + "\"");
  return *value;
}

std::chrono::sys_time<std::chrono::nanoseconds> CsvTable::time(std::size_t column) const {
  // Not through a double: seconds since 1970 with nanoseconds have more digits than it holds.
  std::string_view rest = text(column);
  const bool negative = rest.starts_with('-');
  if (negative) rest.remove_prefix(1);
  const auto point = std::min(rest.find('.'), rest.size());
  const auto whole = parsed<std::int64_t>(rest.substr(0, point));
  std::string digits(point < rest.size() ? rest.substr(point + 1, 9) : std::string_view());
  digits.resize(9, '0');
  const auto fraction = parsed<std::int64_t>(digits);
  if (!whole || *whole < 0 || *whole > 9'000'000'000 || !fraction || *fraction < 0) {
    fail(names_[column] + " must be a time in seconds, got \"" + std::string(text(column)) + "\"");
  }
  const std::chrono::nanoseconds since_zero = std::chrono::seconds(*whole) + std::chrono::nanoseconds(*fraction);
  return std::chrono::sys_time<std::chrono::nanoseconds>(negative ? -since_zero : since_zero);
}

void CsvTable::fail(const std::string& message) const {
  throw ConfigError(file_, line_number_, message);
}

}  // namespace huetrack::yaml
