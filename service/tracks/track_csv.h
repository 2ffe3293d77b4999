// Tracks as CSV: one row per target and frame set, in every state. Locale-independent; numbers read back to the same
// bits.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "calib/files/output_file.h"
#include "object_tracking/object_estimate.h"

namespace huetrack::tracks {

inline constexpr std::string_view track_csv_header =
    "target,t,x,y,z,vx,vy,vz,cxx,cxy,cxz,cyy,cyz,czz,state,views,confidence";

// One row, without the end of line. t: capture time, seconds with 9 decimals, on the clock of estimate.at.
// `nan` where there is no position.
std::string to_csv_row(std::string_view target, const object_tracking::ObjectEstimate& estimate);

// thread-compatible.
class TrackCsvWriter {
 public:
  // throws std::system_error, naming the file; std::runtime_error: something else than tracks is there
  explicit TrackCsvWriter(std::filesystem::path file);
  void write(std::string_view target, const object_tracking::ObjectEstimate& estimate);
  // What is written so far is on disk. throws std::system_error, naming the file: a full disk must not look like a
  // track.
  void flush();

 private:
  files::LineFile file_;
};

// What a TrackCsvWriter (or `huetrack watch --format csv`) wrote: the estimates of each target, in the file's order.
// Fields that the file does not hold have their defaults; set_number counts frame sets: a second row of the same target
// (or object) is of the next one.
// throws ConfigError "file:line: ..."
std::map<std::string, std::vector<object_tracking::ObjectEstimate>> read_track_csv(const std::filesystem::path& file);

}  // namespace huetrack::tracks
