// Tracks and truths as `huetrackd replay --tracks`, `huetrack log` (of targets, and of a tracked camera) and the
// recordings write them: CSV with a header. Pure.
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace huetrack::plot {

struct TrackRow {
  double t = 0;                        // seconds
  std::array<double, 3> position{};    // metres; NaN: there is none
  std::array<double, 6> covariance{};  // xx xy xz yy yz zz, m^2; NaN: there is none
  std::string state;                   // searching, tracking, coasting, lost
  bool has_position() const { return position[0] == position[0]; }
};

struct TruthPoint {
  double t = 0;
  std::array<double, 3> position{};
};

// By target, in the file's order of times. throws std::runtime_error "file:line: what is wrong".
std::map<std::string, std::vector<TrackRow>> read_tracks(const std::filesystem::path& file);
std::map<std::string, std::vector<TruthPoint>> read_truth(const std::filesystem::path& file);

}  // namespace huetrack::plot
