// Regions of the target's colour in one view: what the proposal of our own observation is drawn from. Found only where
// the target may be (the box around the particles' projections), or by a coarse grid over the image while it is
// searched for.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "color/color_window.h"

namespace huetrack::color {

struct ColorRegion {
  int area = 0;                // pixels
  Eigen::Vector2d centre;      // raw pixels, mean of the pixel centres
  Eigen::Matrix2d spread;      // second central moment of the pixels, px^2, with 1/12 for the extent of a pixel itself
  PixelBox box{0, 0, -1, -1};  // of its pixels; of a region of several parts: of all of them
};

// thread-compatible: keeps its work space, so that a frame costs no allocation once it has grown.
class RegionFinder {
 public:
  // The 8-connected regions of at least min_area pixels in the box, largest first. Regions whose centres lie within
  // reach_px of a larger one are counted as parts of it: a thin pole in front of a ball cuts it in two. Regions that
  // the box cuts are as they appear in the box. The reference is valid until the next call.
  const std::vector<ColorRegion>& find(MatchBits& view, PixelBox box, int min_area, double reach_px);

  // Regions of the whole image, looked at through a grid of step_px: a region is not found when no grid point hits
  // it, or only such as lie in the bounding box of another one that was found before. Regions wider than max_extent_px
  // on either side are background and left out.
  const std::vector<ColorRegion>& search(MatchBits& view, int step_px, int max_extent_px, int min_area,
                                         double reach_px);

  // All 8-connected regions of at least min_area pixels that a grid of step_px or one of `also` hits, each whole and by
  // itself, largest first: for who tells apart several objects of one colour. extent_px: about as far as a region
  // reaches from any of its pixels; larger ones take longer. Those wider than largest_px on either side are background
  // and left out.
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
  // Fills moments_, per label, and probed_: the label of the component that has each of the probes (row by row, from
  // the left); -1 when none has.
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
