// How clearly a disc of one colour is distinguished from the ring around it. Pure functions.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "color_teaching/hsi_image.h"

namespace huetrack::color_teaching {

// Hue in degrees and the logarithm of saturation, in units of what white balance, shading and chroma subsampling
// usually change from one camera to the next.
struct Tint {
  float hue = 0, saturation = 0;
};
Tint tint_of(const Eigen::Vector2d& chroma);
double distance(const Tint& a, const Tint& b);
inline constexpr double most_distance = 2.5;  // further away is another colour

struct TintImage {
  explicit TintImage(const HsiImage& image);
  int width, height;
  std::vector<Tint> pixels;
  const Tint& at(int u, int v) const {
    return pixels[static_cast<std::size_t>(v) * static_cast<std::size_t>(width) + static_cast<std::size_t>(u)];
  }
};

struct TintDisc {
  Eigen::Vector2d centre{0, 0};
  double radius = 0;  // px
};

struct DiscContrast {
  Tint tint;                      // median of its inner part
  double tolerance = 0;           // what is nearer to that has its colour
  double inside = 0, around = 0;  // shares of the disc and of the ring that have it
  double cost = 0;                // squared normalised residuals: gaps in the disc, its colour around it
};

// With the tolerance that distinguishes disc and ring best, so that furniture of nearly its colour next to it does not
// have its colour. least: tolerance; what differs less is texture. nullopt: outside the picture.
std::optional<DiscContrast> contrast_of(const TintImage& image, const TintDisc& disc, double least);

// The pixels in the disc, and somewhat around it, that have its colour.
MaskRegion region_of(const TintImage& image, const TintDisc& disc, const DiscContrast& contrast,
                     PixelMask* pixels = nullptr);

}  // namespace huetrack::color_teaching
