// Images of random colours in patches of a few pixels, so that windows, tiles and regions of all kinds occur.
#pragma once

#include <random>
#include <string>
#include <vector>

#include "capture/pixel_format.h"
#include "object_tracking/color_model.h"

namespace huetrack {

inline const std::vector<PixelFormat> all_formats{PixelFormat::yuyv, PixelFormat::nv12, PixelFormat::i420,
                                                  PixelFormat::i422, PixelFormat::i444, PixelFormat::bgr,
                                                  PixelFormat::grey};

// Half of the bytes of each plane are drawn anew, the others repeat the one to the left.
inline Image random_image(PixelFormat format, int width, int height, std::uint64_t seed) {
  WritableImage out = make_image(format, ColorRange::limited, width, height);
  std::mt19937_64 rng(seed);
  for (int plane = 0; plane < 3; ++plane) {
    std::uint8_t* p = out.data[static_cast<std::size_t>(plane)];
    const std::size_t bytes =
        plane_row_bytes(format, plane, width) * static_cast<std::size_t>(plane_rows(format, plane, height));
    const std::size_t period = format == PixelFormat::yuyv   ? 4
                               : format == PixelFormat::bgr  ? 3
                               : format == PixelFormat::nv12 ? 2
                                                             : 1;
    for (std::size_t i = 0; i < bytes; ++i) {
      p[i] = i >= period && rng() % 2 == 0 ? p[i - period] : static_cast<std::uint8_t>(rng());
    }
  }
  return out.image;
}

// Bright grey but for one pixel component in a hundred: most tiles have nothing that matches.
inline Image background_image(PixelFormat format, int width, int height, std::uint64_t seed) {
  WritableImage out = make_image(format, ColorRange::limited, width, height);
  std::mt19937_64 rng(seed);
  for (int plane = 0; plane < 3; ++plane) {
    std::uint8_t* p = out.data[static_cast<std::size_t>(plane)];
    const std::size_t bytes = plane_row_bytes(format, plane, width) * static_cast<std::size_t>(plane_rows(format, plane, height));
    for (std::size_t i = 0; i < bytes; ++i) {
      const bool luma = format == PixelFormat::yuyv ? i % 2 == 0 : plane == 0;
      const auto usual = luma ? 190 + rng() % 30 : 125 + rng() % 7;
      p[i] = static_cast<std::uint8_t>(rng() % 100 == 0 ? rng() : usual);
    }
  }
  return out.image;
}

// A third of all colours. Grey images match this one too, in part: it takes any hue and any saturation.
inline HsiRange common_color(PixelFormat format) {
  return format == PixelFormat::grey ? HsiRange{0, 360, 0, 1, 0.3, 0.6} : HsiRange{60, 240, 0.2, 1, 0.05, 0.95};
}

inline bool matches_at(const Image& image, const ColorTable& table, int u, int v) {
  return image.format == PixelFormat::bgr ? table.contains(bgr_at(image, u, v)) : table.contains(yuv_at(image, u, v));
}

}  // namespace huetrack
