// Normalised cross-correlation (NCC) of a small template with a region of an image.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "camera_tracking/grey_image.h"

namespace huetrack::camera_tracking {

// A square of grey levels, row by row; 1 <= side <= 16. Its anchor is pixel ((side - 1) / 2, (side - 1) / 2), rounded
// down; its centre lies at anchor + centre_offset().
struct NccTemplate {
  int side = 0;
  std::vector<std::uint8_t> pixels;
  float centre_offset() const { return side % 2 == 0 ? 0.5f : 0.0f; }
  std::int32_t sum = 0;
  float norm = 0;  // sqrt(sum of (T - mean)^2); 0: no texture, it correlates with nothing
  void finish();   // sets sum and norm from the pixels
};

// Columns u0..u1 and rows v0..v1, both inclusive, of anchors.
struct PixelRegion {
  int u0 = 0, v0 = 0, u1 = -1, v1 = -1;
  int width() const { return u1 - u0 + 1; }
  int height() const { return v1 - v0 + 1; }
  bool empty() const { return u1 < u0 || v1 < v0; }
  std::size_t index(int u, int v) const { return static_cast<std::size_t>((v - v0) * width() + u - u0); }  // row by row
};
// The anchors of the region at which the template lies inside the image.
PixelRegion clip(const PixelRegion& region, const GreyImage& image, int side);

// rho(u, v) in [-1, 1] at every anchor of a clipped region, row by row; 0 where the image is flat.
//   field  (width x height,) out
// Integer sums: the same bits on every machine. Cost: side^2 multiply-adds per anchor.
void ncc_field(const GreyImage& image, const NccTemplate& t, const PixelRegion& region, std::vector<float>& field);

struct NccPeak {
  float rho = -2;    // -2: none
  int u = 0, v = 0;  // anchor
};
NccPeak best_of(const std::vector<float>& field, const PixelRegion& region);
// Sub-pixel position of the peak by parabolas through its neighbours; at the region's border the anchor itself.
Eigen::Vector2d refined(const NccPeak& peak, const std::vector<float>& field, const PixelRegion& region);

}  // namespace huetrack::camera_tracking
