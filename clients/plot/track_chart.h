// Draws tracks: plan, side view, coordinates, uncertainty, error and states over time. Pure but for the drawing.
#pragma once

#include <string>
#include <vector>

#include "clients/plot/track_file.h"
#include "drawing/canvas.h"

namespace huetrack::plot {

struct ChartTarget {
  std::string name;
  std::vector<TrackRow> rows;
  const truth::Truth* truth = nullptr;  // on the rows' clock, with this target; nullptr: none
};

struct ChartFigures {
  std::string name;
  std::size_t rows = 0, tracking = 0, coasting = 0, lost = 0, searching = 0;
  std::size_t positions = 0;          // rows that have one
  std::size_t in_truth = 0;           // rows with a truth at their time
  std::size_t compared = 0;           // rows with both
  double rms_m = 0, max_m = 0;        // of those
  std::size_t compared_tracking = 0;  // of those: with state tracking
  double tracking_rms_m = 0;
  bool is_ever_near = false;  // within 50 mm of the truth while tracking (`huetrackd compare`: locked)
  double inside_95 = 0;       // share of those whose truth lies in the 95 % ellipsoid
};
ChartFigures figures_of(const ChartTarget& target);
std::string to_text(const ChartFigures& figures);

struct ChartStyle {
  int width = 1500;         // pixels, or SVG units; below 900 the planes are stacked
  std::string title;        // empty: neither title nor figures
  truth::Timestamp zero{};  // of the axis of time
  std::string time_title = "capture time, s";
};
drawing::Canvas draw_chart(const std::vector<ChartTarget>& targets, const ChartStyle& style,
                           drawing::Canvas::Kind kind);

}  // namespace huetrack::plot
