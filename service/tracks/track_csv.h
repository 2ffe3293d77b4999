// Tracks as CSV: one row per target and frame set, in every state. Numbers read back to the same bits.
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

// One row without line end. t: capture time, seconds with 9 decimals, on the clock of estimate.at; nan without a
// position.
std::string to_csv_row(std::string_view target, const object_tracking::ObjectEstimate& estimate);

// thread-compatible.
class TrackCsvWriter {
 public:
  // throws std::runtime_error: the file exists and holds something else; all members throw std::system_error
  explicit TrackCsvWriter(std::filesystem::path file);
  void write(std::string_view target, const object_tracking::ObjectEstimate& estimate) {
    file_.write(to_csv_row(target, estimate));
  }
  void flush() { file_.flush(); }  // to the kernel

 private:
  files::LineFile file_;
};

// Reads a file of TrackCsvWriter or `huetrack watch --format csv`: the estimates of each target, in file order. Other
// fields have defaults; set_number counts frame sets (a repeated target starts the next one). throws files::ConfigError
std::map<std::string, std::vector<object_tracking::ObjectEstimate>> read_track_csv(const std::filesystem::path& file);

}  // namespace huetrack::tracks
