// A film of a disc, whole or interlaced, for tests of what looks for combs.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>

#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

enum class CombRows { progressive, top_first, bottom_first };

struct CombFilm {
  PixelFormat format = PixelFormat::i420;
  CombRows rows = CombRows::progressive;
  double noise = 2;           // levels, standard deviation
  bool has_blind = false;     // a background of stripes, two rows each
  double step_px = 6;         // of the disc, a field
  bool mixes_colors = false;  // i420, nv12: both fields are in every row of colours
  double color = 60;          // levels: of the disc's colours beside the background's
};

// A bright disc that moves to the right, one picture every two fields.
inline Image comb_picture(const CombFilm& film, int k, std::mt19937_64& random) {
  constexpr int width = 160, height = 120, radius = 12;
  const auto made = make_image(film.format, ColorRange::full, width, height);
  std::normal_distribution<double> noise(0, film.noise);
  const int step = film.format == PixelFormat::bgr ? 3 : film.format == PixelFormat::yuyv ? 2 : 1;
  for (int v = 0; v < height; ++v) {
    const bool is_late = film.rows != CombRows::progressive && (v % 2 == 0) != (film.rows == CombRows::top_first);
    const double u0 = 20 + film.step_px * (2 * k + (is_late ? 1 : 0));
    for (int u = 0; u < width; ++u) {
      const double distance = std::hypot(u - u0, v - height / 2);
      const double background = film.has_blind && v / 2 % 2 == 0 ? 90 : 60;
      const double inside = std::clamp(radius - distance + 0.5, 0., 1.);
      const double level = background + inside * (180 - background) + noise(random);
      for (int i = 0; i < step; ++i)
        made.data[0][v * made.image.planes[0].stride + u * step + i] =
            static_cast<std::uint8_t>(std::clamp(level, 0., 255.));
    }
  }
  if (film.format != PixelFormat::i420 && film.format != PixelFormat::nv12) return made.image;
  const int planes = film.format == PixelFormat::i420 ? 2 : 1;
  for (int v = 0; v < height / 2; ++v)
    for (int u = 0; u < width / 2; ++u) {
      const auto inside = [&](bool is_late) {
        const double u0 = 20 + film.step_px * (2 * k + (is_late ? 1 : 0));
        return std::clamp((radius - std::hypot(2 * u - u0, 2 * v - height / 2)) / 2 + 0.5, 0., 1.);
      };
      const bool is_late = film.rows != CombRows::progressive && (v % 2 == 0) != (film.rows == CombRows::top_first);
      const double share = film.mixes_colors ? (inside(false) + inside(true)) / 2 : inside(is_late);
      const auto level = static_cast<std::uint8_t>(128 + film.color * share);
      for (int plane = 1; plane <= planes; ++plane)
        for (int i = 0; i < 3 - planes; ++i)
          made.data[std::size_t(plane)][v * made.image.planes[std::size_t(plane)].stride + (3 - planes) * u + i] =
              level;
    }
  return made.image;
}

}  // namespace huetrack::capture
