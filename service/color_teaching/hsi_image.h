// A whole image in hue, saturation and intensity, and connected regions in it: what teaching works on. Pure values.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "color/color_model.h"
#include "color/color_window.h"

namespace huetrack::color_teaching {

// One byte per pixel, row by row, 0 or 1.
struct PixelMask {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
  PixelMask() = default;
  PixelMask(int w, int h) : width(w), height(h), pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h), 0) {}
  std::uint8_t& at(int u, int v) {
    return pixels[static_cast<std::size_t>(v) * static_cast<std::size_t>(width) + static_cast<std::size_t>(u)];
  }
  std::uint8_t at(int u, int v) const {
    return pixels[static_cast<std::size_t>(v) * static_cast<std::size_t>(width) + static_cast<std::size_t>(u)];
  }
  std::size_t count() const { return static_cast<std::size_t>(std::ranges::count(pixels, 1)); }
};

struct HsiImage {
  int width = 0, height = 0;
  std::vector<color::Hsi> pixels;
  const color::Hsi& at(int u, int v) const {
    return pixels[static_cast<std::size_t>(v) * static_cast<std::size_t>(width) + static_cast<std::size_t>(u)];
  }
};
HsiImage hsi_image(const capture::Image& image);
// A part of it; box: within the image, both corners included.
HsiImage hsi_image(const capture::Image& image, const color::PixelBox& box);

// S and hue as a point: distances in it mean the same for every hue, and do not depend on intensity.
Eigen::Vector2d chroma(const color::Hsi& pixel);

// The pixels that match, except in the boxes.
PixelMask matching(const HsiImage& image, const color::HsiRange& range, const std::vector<color::PixelBox>& ignored);

struct MaskRegion {
  int area = 0;  // pixels
  Eigen::Vector2d centre{0, 0};
  color::PixelBox box{0, 0, -1, -1};
  double radius_px() const { return std::sqrt(area / std::numbers::pi); }  // of a disc of this area
};
// 8-connected, at least min_area pixels, largest first.
std::vector<MaskRegion> regions_of(const PixelMask& mask, int min_area);

// Everything within `px` pixels (in u or in v) of what is set.
PixelMask grown(const PixelMask& mask, int px);

// Sets the pixels of the box, which may reach beyond the mask.
void fill(PixelMask& mask, const color::PixelBox& box, std::uint8_t value);

}  // namespace huetrack::color_teaching
