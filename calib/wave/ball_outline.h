// The ball's outline in one frame to a fraction of a pixel: not by counting the pixels that match its colour, but by
// how much of each pixel it covers.
#pragma once

#include <cstdint>
#include <vector>

#include "calib/wave/background.h"
#include "color/color_region.h"

namespace huetrack::wave {

// The pixels around a region, so that it can be looked at again when the frame is gone.
struct BallPatch {
  struct Pixel {
    std::uint8_t light = 0;
    std::int8_t blue = 0, red = 0;  // chroma; see light_at
    bool match = false;             // has the target's colour
  };
  int u_min = 0, v_min = 0, width = 0, height = 0;  // empty: the region is too large to gain by it
  int chroma_columns = 1;                           // that share one chroma
  std::vector<Pixel> pixels;                        // row by row

  bool empty() const { return pixels.empty(); }
  const Pixel& at(int u, int v) const {
    return pixels[static_cast<std::size_t>(v - v_min) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(u - u_min)];
  }
};

BallPatch patch_around(const capture::Image& image, color::MatchBits& matches, const color::ColorRegion& region);

// A pixel is light of the object's chroma, as bright as the object's shading makes it, over the background's light.
// What of the background is missing is covered. The region itself where that cannot be told.

// The background is taken to be of one colour, that of a ring around the region: a first guess.
color::ColorRegion outline_over_ring(const BallPatch& patch, const color::ColorRegion& region);

// Behind every pixel is what the camera sees there otherwise: the background's own things of the object's hue do no
// harm. Where something else that moves is around the region (the arm that holds it), it is left to
// outline_over_ring().
color::ColorRegion outline_over_background(const BallPatch& patch, const color::ColorRegion& region,
                                           const BackgroundImage& background, const Eigen::Matrix2d& shape);

}  // namespace huetrack::wave
