// Grey images and image pyramids.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "capture/frames/pixel_format.h"

namespace huetrack::camera_tracking {

// 8-bit brightness, read-only. Pixel (0, 0) is the centre of the top-left pixel.
struct GreyImage {
  int width = 0;
  int height = 0;
  std::ptrdiff_t stride = 0;  // bytes from one row to the next
  const std::uint8_t* data = nullptr;
  std::shared_ptr<const void> owner;                      // keeps data alive
  capture::ColorRange range = capture::ColorRange::full;  // the values of black and white

  const std::uint8_t* row(int v) const { return data + v * stride; }
  // Whether all pixels within margin of (u, v) exist.
  bool contains(double u, double v, double margin) const {
    return u >= margin && v >= margin && u <= width - 1 - margin && v <= height - 1 - margin;
  }
};

// Shares the luma plane where the format has one; copies yuyv and bgr. Limited range is not expanded.
GreyImage grey_of(const capture::Image& image);
GreyImage make_grey(int width, int height, std::uint8_t*& pixels);  // owned, zero, full range
GreyImage half_size(const GreyImage& image);  // means of 2x2; an odd last row or column is dropped

// Bilinear; (u, v) with contains(u, v, 0).
inline float sample(const GreyImage& image, float u, float v) {
  const int iu = static_cast<int>(u), iv = static_cast<int>(v);
  const float fu = u - static_cast<float>(iu), fv = v - static_cast<float>(iv);
  const std::uint8_t* a = image.row(iv) + iu;
  const std::ptrdiff_t right = iu + 1 < image.width ? 1 : 0;
  const std::uint8_t* b = iv + 1 < image.height ? a + image.stride : a;
  const float top = static_cast<float>(a[0]) + fu * static_cast<float>(a[right] - a[0]);
  const float bottom = static_cast<float>(b[0]) + fu * static_cast<float>(b[right] - b[0]);
  return top + fv * (bottom - top);
}

// levels[0] is the image, each further one half as large. A pixel (u, v) of level 0 is ((u + 0.5) / 2^l - 0.5, ...) of
// level l.
struct Pyramid {
  std::vector<GreyImage> levels;
  int count() const { return static_cast<int>(levels.size()); }
  const GreyImage& level(int l) const { return levels[static_cast<std::size_t>(l)]; }
};
Pyramid make_pyramid(GreyImage image, int max_levels = 4);  // no side falls below 30 pixels

inline double scale_of(int level) {
  return static_cast<double>(1 << level);
}
inline Eigen::Vector2d to_level(const Eigen::Vector2d& px, int level) {
  return (px.array() + 0.5).matrix() / scale_of(level) - Eigen::Vector2d::Constant(0.5);
}
inline Eigen::Vector2d from_level(const Eigen::Vector2d& px, int level) {
  return (px.array() + 0.5).matrix() * scale_of(level) - Eigen::Vector2d::Constant(0.5);
}

}  // namespace huetrack::camera_tracking
