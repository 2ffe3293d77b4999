// Outlier pixels near an outline: occluders in front of the ball, other things beside it, and glints. Outliers and
// their neighbours, into which they may be blurred, get zero weight.
#pragma once

#include <cstdint>
#include <vector>

#include "outline/edge_samples.h"

namespace huetrack::outline {

class OutlierPixels {
 public:
  static constexpr int largest_grid = 128;  // capacity: pixels, on either side

  OutlierPixels();
  void begin() { is_judged_ = had_glints_ = has_map_ = false, marks_.clear(); }
  // How the set of samples that count has changed.
  enum class Change : std::uint8_t { none, some, at_the_edge };
  // Call after the samples were compared with the model. candidates: number of samples that may be outliers
  // (EdgeSums::outlier_candidates). Sets the samples' trust.
  Change judge(double candidates, const PixelGrid& grid, EdgeSamples& light, EdgeSamples& chroma);

 private:
  enum class Kind : std::uint8_t { other_thing, occluder, glint };
  struct Mark {
    int u, v;  // in the picture
    Kind kind;
  };
  bool find_glints(EdgeSamples& light);
  void find_outliers(const PixelGrid& grid, EdgeSamples& light, EdgeSamples& chroma);
  Change distrust_marked(const PixelGrid& grid, EdgeSamples& light, EdgeSamples& chroma);

  bool had_glints_ = false, is_judged_ = false;
  bool has_map_ = false;  // the samples' trust follows near_marks_
  std::vector<Mark> marks_;
  std::vector<std::uint8_t> near_marks_, near_marks_before_;  // of the grid, row by row
};

}  // namespace huetrack::outline
