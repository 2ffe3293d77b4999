// Corner detection and a binary descriptor.
#pragma once

#include <Eigen/Core>
#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "camera_tracking/grey_image.h"

namespace huetrack::camera_tracking {

struct Corner {
  Eigen::Vector2d px;  // of its level
  float score = 0;     // smaller eigenvalue of the gradients' moments (Shi and Tomasi), per pixel
};
// FAST corners (Rosten and Drummond 2006) of the whole image or of columns u0..u1, rows v0..v1, with Shi-Tomasi scores,
// best first.
//   margin  pixels from a corner to the image's border, at least
std::vector<Corner> detect_corners(const GreyImage& image, int threshold, int margin, float min_score);
std::vector<Corner> detect_corners(const GreyImage& image, int threshold, int margin, float min_score, int u0, int v0,
                                   int u1, int v1);
float corner_score(const GreyImage& image, int u, int v);  // of 7 x 7 pixels

// 256 brightness comparisons in a disc, rotated to its intensity centroid (as ORB, Rublee et al. 2011, with other
// pairs). Invariant to brightness, contrast and rotation; tolerates moderate changes of scale and viewpoint.
using Descriptor = std::array<std::uint64_t, 4>;
constexpr int descriptor_margin = 14;  // layout: pixels of its level around the disc's centre
Descriptor describe(const GreyImage& image, const Eigen::Vector2d& px);
inline int distance(const Descriptor& a, const Descriptor& b) {
  return std::popcount(a[0] ^ b[0]) + std::popcount(a[1] ^ b[1]) + std::popcount(a[2] ^ b[2]) +
         std::popcount(a[3] ^ b[3]);
}

}  // namespace huetrack::camera_tracking
