// `huetrack plot`: the track, its states and its uncertainty as a picture.
#pragma once

#include <filesystem>

namespace huetrack::plot {

struct PlotOptions {
  std::filesystem::path tracks;  // CSV
  std::filesystem::path truth;   // CSV; empty: none
  std::filesystem::path out;     // .png, .svg or .html (one file that needs no other)
  double clock_offset_s = 0;     // the tracks' clock minus the truth's
};

// throws std::runtime_error, one readable line: a file that is wrong (naming file and line), or cannot be written.
void plot(const PlotOptions& options);

}  // namespace huetrack::plot
