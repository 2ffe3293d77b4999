#include "tracks/track_csv.h"

#include <cmath>
#include <optional>

#include "calib/files/csv_table.h"
#include "calib/files/number_text.h"

namespace huetrack::tracks {
namespace {

void append(std::string& row, double value) {
  row += ',';
  if (std::isnan(value))
    row += "nan";  // not -nan
  else
    files::append_shortest(row, value);
}

std::optional<object_tracking::TrackState> track_state_of(std::string_view word) {
  for (const auto state : {object_tracking::TrackState::searching, object_tracking::TrackState::tracking,
                           object_tracking::TrackState::coasting, object_tracking::TrackState::lost}) {
    if (object_tracking::name(state) == word) return state;
  }
  return std::nullopt;
}

constexpr files::FileKind kind{"tracks", [](std::string_view text) { return text.starts_with("target,t,"); }};

}  // namespace

std::string to_csv_row(std::string_view target, const object_tracking::ObjectEstimate& e) {
  std::string row(target);
  row += ',' + files::seconds_text(e.at.time_since_epoch().count());
  for (int i = 0; i < 3; ++i) append(row, e.position[i]);
  for (int i = 0; i < 3; ++i) append(row, e.velocity[i]);
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) append(row, e.covariance(i, j));
  }
  row += ',';
  row += object_tracking::name(e.state);
  row += ',';
  row += std::to_string(e.views);
  append(row, e.confidence);
  return row;
}

TrackCsvWriter::TrackCsvWriter(std::filesystem::path file) : file_(std::move(file), kind, track_csv_header) {}

std::map<std::string, std::vector<object_tracking::ObjectEstimate>> read_track_csv(const std::filesystem::path& file) {
  static constexpr std::string_view columns[] = {"target", "t",   "x",     "y",     "z",         "vx",
                                                 "vy",     "vz",  "cxx",   "cxy",   "cxz",       "cyy",
                                                 "cyz",    "czz", "state", "views", "confidence"};
  files::CsvTable table(file, columns);
  table.skip_truncated_row();
  std::map<std::string, std::vector<object_tracking::ObjectEstimate>> tracks;
  std::uint64_t set_number = 0;
  while (table.next()) {
    auto& track = tracks[std::string(table.text(0))];
    if (!track.empty() && track.back().set_number == set_number) ++set_number;
    object_tracking::ObjectEstimate& e = track.emplace_back();
    e.set_number = set_number;
    e.at = table.time(1);
    for (int i = 0; i < 3; ++i) e.position[i] = table.number(std::size_t(2 + i));
    for (int i = 0; i < 3; ++i) e.velocity[i] = table.number(std::size_t(5 + i));
    std::size_t column = 8;
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j) e.covariance(i, j) = e.covariance(j, i) = table.number(column++);
    }
    const auto state = track_state_of(table.text(14));
    if (!state) table.fail("state must be searching, tracking, coasting or lost, got " + table.quoted(14));
    e.state = *state;
    const double views = table.number(15);
    if (!(views >= 0 && views <= 1000)) table.fail("views must be a number of cameras, got " + table.quoted(15));
    e.views = static_cast<int>(views);
    e.confidence = table.number(16);
  }
  return tracks;
}

}  // namespace huetrack::tracks
