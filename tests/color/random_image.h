// Images of random colours in patches of a few pixels, so that windows, tiles and regions of all kinds occur.
#pragma once

#include <cstdint>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "capture/frames/pixel_format.h"
#include "color/color_model.h"
#include "color/color_window.h"

namespace huetrack::color {

inline const std::vector<capture::PixelFormat> all_formats{
    capture::PixelFormat::yuyv, capture::PixelFormat::nv12, capture::PixelFormat::i420, capture::PixelFormat::i422,
    capture::PixelFormat::i444, capture::PixelFormat::bgr,  capture::PixelFormat::grey};

// byte: of a plane, by the plane's number, its bytes up to here, and random numbers.
template <typename Byte>
capture::Image image_of_bytes(capture::PixelFormat format, int width, int height, std::uint64_t seed, Byte byte) {
  capture::WritableImage out = capture::make_image(format, capture::ColorRange::limited, width, height);
  std::mt19937_64 rng(seed);
  for (int plane = 0; plane < 3; ++plane) {
    std::uint8_t* p = out.data[static_cast<std::size_t>(plane)];
    const std::size_t bytes = capture::plane_row_bytes(format, plane, width) *
                              static_cast<std::size_t>(capture::plane_rows(format, plane, height));
    for (std::size_t i = 0; i < bytes; ++i) p[i] = static_cast<std::uint8_t>(byte(plane, std::span(p, i), rng));
  }
  return out.image;
}

// Half of the bytes of each plane are drawn anew, the others repeat the one to the left.
inline capture::Image random_image(capture::PixelFormat format, int width, int height, std::uint64_t seed) {
  const std::size_t period = format == capture::PixelFormat::yuyv   ? 4
                             : format == capture::PixelFormat::bgr  ? 3
                             : format == capture::PixelFormat::nv12 ? 2
                                                                    : 1;
  return image_of_bytes(format, width, height, seed,
                        [&](int, std::span<const std::uint8_t> before, std::mt19937_64& rng) -> std::uint64_t {
                          const bool repeats = before.size() >= period && rng() % 2 == 0;
                          return repeats ? before[before.size() - period] : rng();
                        });
}

// Bright grey but for one pixel component in a hundred: most tiles have nothing that matches.
inline capture::Image background_image(capture::PixelFormat format, int width, int height, std::uint64_t seed) {
  return image_of_bytes(format, width, height, seed,
                        [&](int plane, std::span<const std::uint8_t> before, std::mt19937_64& rng) {
                          const bool luma = format == capture::PixelFormat::yuyv ? before.size() % 2 == 0 : plane == 0;
                          const std::uint64_t usual = luma ? 190 + rng() % 30 : 125 + rng() % 7;
                          return rng() % 100 == 0 ? rng() : usual;
                        });
}

// A third of all colours. Grey images match this one too, in part: it takes any hue and any saturation.
inline HsiRange common_color(capture::PixelFormat format) {
  return format == capture::PixelFormat::grey ? HsiRange{0, 360, 0, 1, 0.3, 0.6}
                                              : HsiRange{60, 240, 0.2, 1, 0.05, 0.95};
}

inline bool matches_at(const capture::Image& image, const ColorTable& table, int u, int v) {
  return image.format == capture::PixelFormat::bgr ? table.contains(capture::bgr_at(image, u, v))
                                                   : table.contains(capture::yuv_at(image, u, v));
}

// The obvious way, one look-up per pixel of the window: the truth that count_5x5() is held to.
inline int count_5x5_reference(const capture::Image& image, const ColorTable& table, int u, int v) {
  int k = 0;
  for (int dv = -2; dv <= 2; ++dv) {
    for (int du = -2; du <= 2; ++du) {
      const int uu = u + du, vv = v + dv;
      if (uu >= 0 && vv >= 0 && uu < image.width && vv < image.height && has_color(image, table, uu, vv)) ++k;
    }
  }
  return k;
}

}  // namespace huetrack::color
