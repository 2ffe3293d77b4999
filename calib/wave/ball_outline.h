// The ball's outline in one frame to a fraction of a pixel, from how much of each pixel the ball covers.
#pragma once

#include <cstdint>
#include <vector>

#include "calib/wave/background.h"
#include "color/color_region.h"

namespace huetrack::wave {

// Copy of the pixels around a region: the frame itself is not kept.
struct BallPatch {
  struct Pixel {
    std::uint8_t light = 0;
    std::int8_t blue = 0, red = 0;  // chroma; see light_at
    bool match = false;             // has the target's colour
  };
  int u_min = 0, v_min = 0, width = 0, height = 0;  // empty: the region is too large to gain by it
  int chroma_columns = 1;                           // that share one chroma sample
  std::vector<Pixel> pixels;                        // row by row

  bool empty() const { return pixels.empty(); }
  const Pixel& at(int u, int v) const {
    return pixels[static_cast<std::size_t>(v - v_min) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(u - u_min)];
  }
};

BallPatch patch_around(const capture::Image& image, color::MatchBits& matches, const color::ColorRegion& region);

// Both model a pixel as a mixture of ball and background, and return the region itself where these cannot be separated.

// First guess: the background has one colour, that of a ring around the region.
color::ColorRegion outline_over_ring(const BallPatch& patch, const color::ColorRegion& region);

// Over the known background, which may contain the ball's hue. Returns the region itself where something else moves
// around it (an arm). shape: px per radian of a small ball there.
color::ColorRegion outline_over_background(const BallPatch& patch, const color::ColorRegion& region,
                                           const BackgroundImage& background, const Eigen::Matrix2d& shape);

}  // namespace huetrack::wave
