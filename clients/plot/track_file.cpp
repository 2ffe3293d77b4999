#include "clients/plot/track_file.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "calib/files/config_error.h"
#include "calib/files/csv_table.h"

namespace huetrack::plot {
namespace {

// Larger values are mistakes, and would flatten the rest of the picture.
constexpr double farthest_m = 1e5, largest_variance_m2 = 1e8;

double bounded(const files::CsvTable& table, std::size_t column, double most) {
  const double value = table.number(column);
  if (std::abs(value) > most) table.fail(table.name(column) + " is absurd: " + table.quoted(column));
  return value;
}

constexpr std::size_t most_objects = 1000;  // each has five curves

}  // namespace

std::map<std::string, std::vector<TrackRow>> read_tracks(const std::filesystem::path& file) {
  // The second names are those of a camera's log, whose covariance has rows for the orientation, too.
  static constexpr std::string_view columns[] = {
      "target|camera", "t",       "state", "x",    "y",    "z",    "cxx|c11", "cxy|c12", "cxz|c13", "cyy|c22",
      "cyz|c23",       "czz|c33", "qx?",   "qy?",  "qz?",  "qw?",  "c11?",    "c12?",    "c13?",    "c14?",
      "c15?",          "c16?",    "c22?",  "c23?", "c24?", "c25?", "c26?",    "c33?",    "c34?",    "c35?",
      "c36?",          "c44?",    "c45?",  "c46?", "c55?", "c56?", "c66?"};
  constexpr std::size_t orientation = 12, pose_covariance = 16;  // where those of a camera begin
  static constexpr std::string_view states[] = {"tracking", "coasting", "searching", "lost"};
  files::CsvTable table(file, columns);
  table.reject_ragged_rows();
  table.skip_truncated_row();
  std::map<std::string, std::vector<TrackRow>> tracks;
  while (table.next()) {
    if (tracks.size() > most_objects)
      table.fail(fmt::format("this is the {}th object: no more than {} can be drawn; plot a part of the file",
                             tracks.size(), most_objects));
    TrackRow row;
    row.at = table.time(1);
    row.state = table.text(2);
    if (std::ranges::find(states, row.state) == std::end(states))
      table.fail("state must be searching, tracking, coasting or lost, got " + table.quoted(2));
    for (int i = 0; i < 3; ++i) row.position[i] = bounded(table, std::size_t(3 + i), farthest_m);
    if (row.position.hasNaN() && !row.position.array().isNaN().all()) table.fail("a part of the position is missing");
    std::size_t column = 6;
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j)
        row.covariance(i, j) = row.covariance(j, i) = bounded(table, column++, largest_variance_m2);
    row.is_camera = table.name(0) == "camera";
    for (std::size_t i = 0; i < 4 && row.is_camera && table.has(orientation + i); ++i)
      row.orientation[Eigen::Index(i)] = bounded(table, orientation + i, 2);
    for (std::size_t i = 0; i < row.pose_covariance.size() && row.is_camera && table.has(pose_covariance + i); ++i)
      row.pose_covariance[i] = bounded(table, pose_covariance + i, largest_variance_m2);
    tracks[std::string(table.text(0))].push_back(std::move(row));
  }
  if (tracks.empty()) throw files::ConfigError(file, 0, "holds no row");
  for (auto& [name, rows] : tracks) std::ranges::stable_sort(rows, {}, &TrackRow::at);
  return tracks;
}

}  // namespace huetrack::plot
