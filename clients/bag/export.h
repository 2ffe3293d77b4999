// `huetrack export`: a track, a recording's pictures, or both, as a rosbag2 or as MCAP.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace huetrack::bag {

struct BagOptions {
  std::filesystem::path tracks;  // CSV, of targets or of a tracked camera; empty: pictures alone
  // A recording, or CAMERA=FILE for each camera; empty: none.
  std::vector<std::string> pictures;
  std::filesystem::path rig;       // of the cameras; empty: the recording's own, if it has one
  std::filesystem::path out;       // FILE.mcap, or the folder of a rosbag2
  std::string frame_id = "world";  // the world's name
  double clock_offset_s = 0;       // added to all times
};

// Prints a summary on stdout. Throws std::runtime_error with a one-line message: an invalid file (with file and line),
// or one that cannot be written.
void export_track(const BagOptions& options);

}  // namespace huetrack::bag
