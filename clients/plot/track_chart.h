// Draws tracks with cairo: the same drawing is a PNG or an SVG. Pure but for the drawing.
#pragma once

#include <cairo/cairo.h>

#include <string>
#include <vector>

#include "clients/plot/track_file.h"

namespace huetrack::plot {

struct ChartTarget {
  std::string name;
  std::vector<TrackRow> rows;
  std::vector<TruthPoint> truth;  // on the rows' clock; empty: none
};

struct TargetFigures {
  std::string name;
  std::size_t rows = 0, tracking = 0, coasting = 0, lost = 0, searching = 0;
  std::size_t compared = 0;     // rows with a position for which the truth has this very time
  double rms_m = 0, max_m = 0;  // of those
  double inside_95 = 0;         // share of those whose truth lies in the 95 % ellipsoid
};
TargetFigures figures_of(const ChartTarget& target);
std::string to_text(const TargetFigures& figures);

inline constexpr int chart_width = 1500;  // pixels, or SVG units
int chart_height(const std::vector<ChartTarget>& targets);
void draw_chart(cairo_t* cairo, const std::string& title, const std::vector<ChartTarget>& targets);

}  // namespace huetrack::plot
