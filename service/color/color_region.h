// Connected regions of the target's colour in one view: in a box around its predicted position, or by a coarse grid
// over the whole image during a search.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "color/color_window.h"

namespace huetrack::color {

// How much a disc stands out from what is around it (DiscFinder): natural logarithms of odds, beyond those at which one
// disc of its size in the whole picture would be chance.
struct DiscEvidence {
  double odds = 0;  // >= 0
  double most = 0;  // that a disc of its size can have; 0: not measured
};

struct ColorRegion {
  int area = 0;                // pixels
  Eigen::Vector2d centre;      // raw pixels, mean of the pixel centres
  Eigen::Matrix2d spread;      // second central moment of the pixels, px^2, with 1/12 for the extent of a pixel itself
  PixelBox box{0, 0, -1, -1};  // of its pixels; of a region of several parts: of all of them
  // px^2, how badly the pixels fix the centre of the disc that they are of; 0: it is that of the pixels (DiscFinder)
  Eigen::Matrix2d of_disc = Eigen::Matrix2d::Zero();
  DiscEvidence evidence = {};
};

// The convex hull of the matching pixels in the box. Of a disc with stripes, glints or a covered part, it has more of
// the disc's own area than what matches. Of a disc of which all pixels match it is the same (Pick's theorem).
struct ConvexHull {
  int area = 0;                                      // pixels within it
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();  // second central moment, px^2; 0: all pixels are on one line
};
ConvexHull hull_of(MatchBits& view, PixelBox box);

// thread-compatible. Keeps its work space between frames.
class RegionFinder {
 public:
  // All references that are returned are valid until the next call; regions are sorted, largest first.

  // The 8-connected regions of at least min_area pixels in the box, cut at its border. Regions whose centres lie within
  // reach_px of a larger one are its parts: a thin pole in front of a ball cuts it in two.
  const std::vector<ColorRegion>& find(MatchBits& view, PixelBox box, int min_area, double reach_px);

  // Regions of the whole image that a grid of step_px hits outside of the bounding boxes of those found before. Regions
  // wider than max_extent_px on either side are background and left out.
  const std::vector<ColorRegion>& search(MatchBits& view, int step_px, int max_extent_px, int min_area,
                                         double reach_px);

  // All 8-connected regions of at least min_area pixels that a grid of step_px or one of `also` hits, each whole,
  // without joining parts: for several objects of one colour. extent_px: usual reach of a region from any of its
  // pixels; larger ones take longer. Those wider than largest_px on either side are background and left out.
  const std::vector<ColorRegion>& components(MatchBits& view, int step_px, std::span<const PixelAt> also, int extent_px,
                                             int largest_px, int min_area);

 private:
  struct Run {
    int u_min, u_max, label;
  };
  struct Moments {
    double n = 0, u = 0, v = 0, uu = 0, uv = 0, vv = 0;
    PixelBox box{1 << 30, 1 << 30, -1, -1};
    void add(const Moments& other);
  };
  int root(int label);
  // Fills moments_, per label, and probed_: the label of each probe's component (row by row, from the left); -1: none.
  void label_runs(MatchBits& view, const PixelBox& box, std::span<const PixelAt> probes);
  void collect(int min_area, double reach_px);

  std::vector<PixelAt> hits_, probes_;
  std::vector<std::size_t> probes_of_;  // which of hits_ they are
  std::vector<char> is_taken_;          // per hit
  std::vector<int> probed_;
  std::vector<Run> above_, current_;
  std::vector<int> words_;  // of a row, where some match
  std::vector<int> parent_;
  std::vector<Moments> moments_;  // per label
  std::vector<Moments> found_;
  std::vector<ColorRegion> regions_;
};

}  // namespace huetrack::color
