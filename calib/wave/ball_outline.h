// The ball's outline in one frame to a fraction of a pixel, from how much of each pixel the ball covers.
#pragma once

#include <cstdint>
#include <vector>

#include "calib/wave/background.h"
#include "color/color_region.h"
#include "outline/outline_fit.h"

namespace huetrack::wave {

// Copy of the pixels around a region: the frame itself is not kept.
struct BallPatch {
  struct Pixel {
    std::uint8_t light = 0, blue = 128, red = 128;  // full range; chroma + 128 (see light_at)
    bool match = false;                             // has the target's colour
  };
  int image_width = 0, image_height = 0;
  int u_min = 0, v_min = 0, width = 0, height = 0;  // px, even; empty: the region is too large to gain by it
  int columns = 1, rows = 1;                        // of pixels that share one chroma sample
  std::vector<Pixel> pixels;                        // row by row

  bool empty() const { return pixels.empty(); }
  const Pixel& at(int u, int v) const {
    return pixels[static_cast<std::size_t>(v - v_min) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(u - u_min)];
  }
  outline::Picture picture() const;  // its bytes are the patch's
};

BallPatch patch_around(const capture::Image& image, color::MatchBits& matches, const color::ColorRegion& region);

// First guess: the background has one colour, that of a ring around the region. Returns the region itself where ball
// and ring cannot be separated.
color::ColorRegion outline_over_ring(const BallPatch& patch, const color::ColorRegion& region);

// Fits one camera's outlines, frame by frame, over its background. thread-compatible.
class OutlineOverBackground {
 public:
  explicit OutlineOverBackground(const CameraBackground& background) : background_(background) {}

  // shape: px per radian of a small ball there. Returns the region itself where no outline fits.
  color::ColorRegion fit(const BallPatch& patch, const color::ColorRegion& region, const Eigen::Matrix2d& shape,
                         const outline::Movement& movement, double t_s);

 private:
  const CameraBackground& background_;
  outline::OutlineFit fit_;
  outline::AppearanceModel look_;
  Eigen::Vector2d lit_px_ = Eigen::Vector2d::Zero();  // where, and when, the light over the ball was learnt last
  double lit_s_ = 0;
};

}  // namespace huetrack::wave
