// How clearly a disc of one colour is distinguished from the ring around it. Pure functions.
#pragma once

#include <Eigen/Core>
#include <algorithm>
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

// visit(u, v, distance from the centre) for each pixel of a picture that is in the disc.
template <typename Visit>
void visit_disc(int width, int height, const TintDisc& disc, const Visit& visit) {
  const int v_max = std::min(height - 1, int(disc.centre.y() + disc.radius));
  const int u_max = std::min(width - 1, int(disc.centre.x() + disc.radius));
  for (int v = std::max(0, int(disc.centre.y() - disc.radius)); v <= v_max; ++v)
    for (int u = std::max(0, int(disc.centre.x() - disc.radius)); u <= u_max; ++u)
      if (const double d = (Eigen::Vector2d(u, v) - disc.centre).norm(); d <= disc.radius) visit(u, v, d);
}

struct DiscContrast {
  Tint tint;                      // median of its inner part
  double tolerance = 0;           // what is nearer to that has its colour
  double inside = 0, around = 0;  // shares of the disc and of the ring that have it
  double cost = 0;                // squared normalised residuals: gaps in the disc, its colour around it
};

// With the tolerance that distinguishes disc and ring best, so that furniture of nearly its colour next to it does not
// have its colour. least: tolerance; what differs less is texture. nullopt: outside the picture.
std::optional<DiscContrast> contrast_of(const TintImage& image, const TintDisc& disc, double least);

inline constexpr double region_reach = 1.25;  // radii within which region_of() looks
// The pixels in the disc, and somewhat around it, that have its colour.
MaskRegion region_of(const TintImage& image, const TintDisc& disc, const DiscContrast& contrast,
                     PixelMask* pixels = nullptr);

}  // namespace huetrack::color_teaching
