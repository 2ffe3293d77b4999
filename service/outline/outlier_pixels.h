// Pixels near an outline that are not what a dull ball before its background shows: what hides it, what else is there,
// and glints. None of them counts, nor do their neighbours, which they may have softened.
#pragma once

#include <cstdint>
#include <vector>

#include "outline/edge_samples.h"

namespace huetrack::outline {

class StrangePixels {
 public:
  static constexpr int largest_grid = 128;  // of pixels, on either side

  StrangePixels();
  void begin() { is_judged_ = had_glints_ = has_map_ = false, marks_.clear(); }
  // Which samples count from now on.
  enum class Count : std::uint8_t { the_same, others, others_at_the_edge };
  // After samples were compared with what is expected of them. might_be: so many of them ask for it
  // (EdgeSums::strange). Sets their trust.
  Count judge(double might_be, const PixelGrid& grid, EdgeSamples& light, EdgeSamples& chroma);

 private:
  enum class Strange : std::uint8_t { is_else, hides, shines };
  struct Mark {
    int u, v;  // in the picture
    Strange as;
  };
  bool find_glints(EdgeSamples& light);
  void find_strange(const PixelGrid& grid, EdgeSamples& light, EdgeSamples& chroma);
  Count distrust_marked(const PixelGrid& grid, EdgeSamples& light, EdgeSamples& chroma);

  bool had_glints_ = false, is_judged_ = false;
  bool has_map_ = false;  // trust is by near_marks_
  std::vector<Mark> marks_;
  std::vector<std::uint8_t> near_marks_, near_marks_before_;  // of the grid, row by row
};

}  // namespace huetrack::outline
