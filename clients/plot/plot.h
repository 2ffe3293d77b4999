// `huetrack plot`: the track, its states and its uncertainty as a picture.
#pragma once

#include <filesystem>

#include "truth/alignment.h"

namespace huetrack::plot {

struct PlotOptions {
  std::filesystem::path tracks;                 // CSV
  std::filesystem::path truth;                  // CSV; empty: none
  std::filesystem::path out;                    // .png, .svg or .html (one file that needs no other)
  double clock_offset_s = 0;                    // the tracks' clock minus the truth's
  truth::Freedom align = truth::Freedom::none;  // the tracks, all together, with the truth
  bool align_time = false;
};

// Throws std::runtime_error with a one-line message: an invalid file (with file and line), or one that cannot be
// written.
void plot(const PlotOptions& options);

}  // namespace huetrack::plot
