#include "clients/plot/track_file.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string_view>

namespace huetrack::plot {
namespace {

constexpr std::size_t npos = static_cast<std::size_t>(-1);

// A CSV file, row by row, its fields by the names in the first row.
class Table {
 public:
  explicit Table(const std::filesystem::path& file) : file_(file), stream_(file) {
    if (!stream_) throw std::runtime_error(file.string() + ": cannot be read: " + std::strerror(errno));
    if (!next()) throw std::runtime_error(file.string() + ": is empty");
    names_ = fields_;
  }
  bool next() {
    std::string line;
    while (std::getline(stream_, line)) {
      ++line_;
      if (!line.empty() && line.back() == '\r') line.pop_back();
      if (line.empty()) continue;
      fields_.assign(1, {});
      for (const char c : line) {
        if (c == ',') {
          fields_.emplace_back();
        } else {
          fields_.back() += c;
        }
      }
      if (!names_.empty() && fields_.size() != names_.size())
        fail("has " + std::to_string(fields_.size()) + " fields, but the header " + std::to_string(names_.size()));
      return true;
    }
    if (stream_.bad()) throw std::runtime_error(file_.string() + ": cannot be read on");
    return false;
  }
  std::size_t find(std::string_view name) const {
    const auto it = std::ranges::find(names_, name);
    return it == names_.end() ? npos : static_cast<std::size_t>(it - names_.begin());
  }
  std::size_t column(std::string_view name) const {
    if (const std::size_t at = find(name); at != npos) return at;
    throw std::runtime_error(file_.string() + ":1: there is no column " + std::string(name) +
                             ": is it a track (or truth) CSV?");
  }
  const std::string& text(std::size_t column) const { return fields_[column]; }
  double number(std::size_t column) const {
    const std::string& field = fields_[column];
    if (field.empty() || field == "nan" || field == "-nan") return std::numeric_limits<double>::quiet_NaN();
    double value = 0;
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (error != std::errc{} || end != field.data() + field.size())
      fail(names_[column] + " is no number: \"" + field + "\"");
    return value;
  }
  double time(std::size_t column) const {
    const double t = number(column);
    if (!std::isfinite(t)) fail("there is no time");
    return t;
  }

 private:
  [[noreturn]] void fail(const std::string& message) const {
    throw std::runtime_error(file_.string() + ":" + std::to_string(line_) + ": " + message);
  }
  std::filesystem::path file_;
  std::ifstream stream_;
  std::vector<std::string> names_, fields_;
  int line_ = 0;
};

}  // namespace

std::map<std::string, std::vector<TrackRow>> read_tracks(const std::filesystem::path& file) {
  Table table(file);
  const std::size_t target = table.column("target"), t = table.column("t"), state = table.column("state");
  constexpr const char* position_names[] = {"x", "y", "z"};
  constexpr const char* covariance_names[] = {"cxx", "cxy", "cxz", "cyy", "cyz", "czz"};
  std::array<std::size_t, 3> position{};
  std::array<std::size_t, 6> covariance{};
  for (std::size_t i = 0; i < 3; ++i) position[i] = table.column(position_names[i]);
  for (std::size_t i = 0; i < 6; ++i) covariance[i] = table.column(covariance_names[i]);
  std::map<std::string, std::vector<TrackRow>> tracks;
  while (table.next()) {
    TrackRow row{.t = table.time(t), .state = table.text(state)};
    for (std::size_t i = 0; i < 3; ++i) row.position[i] = table.number(position[i]);
    for (std::size_t i = 0; i < 6; ++i) row.covariance[i] = table.number(covariance[i]);
    tracks[table.text(target)].push_back(std::move(row));
  }
  if (tracks.empty()) throw std::runtime_error(file.string() + ": holds no row");
  for (auto& [name, rows] : tracks) std::ranges::stable_sort(rows, {}, &TrackRow::t);
  return tracks;
}

std::map<std::string, std::vector<TruthPoint>> read_truth(const std::filesystem::path& file) {
  Table table(file);
  const std::size_t name = table.find("ball"), t = table.column("t");
  const std::array<std::size_t, 3> position = {table.column("x"), table.column("y"), table.column("z")};
  std::map<std::string, std::vector<TruthPoint>> truth;
  while (table.next()) {
    TruthPoint point{.t = table.time(t)};
    for (std::size_t i = 0; i < 3; ++i) point.position[i] = table.number(position[i]);
    truth[name == npos ? "" : table.text(name)].push_back(point);
  }
  for (auto& [ball, points] : truth) std::ranges::stable_sort(points, {}, &TruthPoint::t);
  return truth;
}

}  // namespace huetrack::plot
