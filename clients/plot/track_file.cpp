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
  // No farther from 0 than `most`: what is larger is a mistake, and would flatten the rest of the picture.
  double bounded(std::size_t column, double most) const {
    const double value = number(column);
    if (std::abs(value) > most) fail(names_[column] + " is absurd: " + fields_[column]);
    return value;
  }
  double time(std::size_t column) const {
    const double t = bounded(column, 1e11);
    if (std::isnan(t)) fail("there is no time");
    return t;
  }
  std::array<double, 3> position(const std::array<std::size_t, 3>& columns) const {
    constexpr double farthest = 1e5;  // m
    const std::array<double, 3> p{bounded(columns[0], farthest), bounded(columns[1], farthest),
                                  bounded(columns[2], farthest)};
    const auto missing = std::ranges::count_if(p, [](double v) { return std::isnan(v); });
    if (missing != 0 && missing != 3) fail("a part of the position is missing");
    return p;
  }

  [[noreturn]] void fail(const std::string& message) const {
    throw std::runtime_error(file_.string() + ":" + std::to_string(line_) + ": " + message);
  }

 private:
  std::filesystem::path file_;
  std::ifstream stream_;
  std::vector<std::string> names_, fields_;
  int line_ = 0;
};

}  // namespace

std::map<std::string, std::vector<TrackRow>> read_tracks(const std::filesystem::path& file) {
  Table table(file);
  const bool is_camera =
      table.find("camera") != npos;  // of `huetrack log --camera`: its position's covariance is c11...
  const std::size_t target = table.column(is_camera ? "camera" : "target"), t = table.column("t"),
                    state = table.column("state");
  constexpr const char* position_names[] = {"x", "y", "z"};
  constexpr const char* of_targets[] = {"cxx", "cxy", "cxz", "cyy", "cyz", "czz"};
  constexpr const char* of_cameras[] = {"c11", "c12", "c13", "c22", "c23", "c33"};
  const auto& covariance_names = is_camera ? of_cameras : of_targets;
  constexpr std::string_view states[] = {"tracking", "coasting", "searching", "lost"};
  std::array<std::size_t, 3> position{};
  std::array<std::size_t, 6> covariance{};
  for (std::size_t i = 0; i < 3; ++i) position[i] = table.column(position_names[i]);
  for (std::size_t i = 0; i < 6; ++i) covariance[i] = table.column(covariance_names[i]);
  std::map<std::string, std::vector<TrackRow>> tracks;
  while (table.next()) {
    TrackRow row{.t = table.time(t), .state = table.text(state)};
    if (std::ranges::find(states, row.state) == std::end(states))
      table.fail("state must be searching, tracking, coasting or lost, got \"" + row.state + "\"");
    row.position = table.position(position);
    for (std::size_t i = 0; i < 6; ++i) row.covariance[i] = table.bounded(covariance[i], 1e8);
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
    point.position = table.position(position);
    if (std::isnan(point.position[0])) table.fail("x, y and z must be finite");
    truth[name == npos ? "" : table.text(name)].push_back(point);
  }
  for (auto& [ball, points] : truth) std::ranges::stable_sort(points, {}, &TruthPoint::t);
  return truth;
}

}  // namespace huetrack::plot
