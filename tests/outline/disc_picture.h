// Pictures of a ball's disc in front of a room, with exact truth: light is mixed as a sensor counts it.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <random>
#include <vector>

#include "outline/picture.h"

namespace huetrack::outline {

struct DiscScene {
  Eigen::Vector2d centre{60.3, 44.8};
  double radius_px = 7, blur_px = 0.7;
  bool is_blurred_disc = false;  // as lenses do; else the edge's profile is that of a half plane
  double smear_px = 0;           // motion along u during the exposure
  double shear_px = 0;           // rolling shutter: motion along u per row
  bool has_disc = true;
  int pillar_from = -1;  // columns from here on occlude the disc
  int finger_from = -1;  // the same by a finger of nearly its colour, which is not background
  double noise = 1;      // grey values
  double light = 1;      // of the room
  double gain = 1;       // of everything: the exposure
  double bent = 0;       // shading that is stronger on one side, but not at the rim
  double glint = 0;      // linear, white: a lamp's reflection near the upper right of the edge
};

class DiscPicture {
 public:
  static constexpr int width = 128, height = 96;

  Picture draw(const DiscScene& scene, unsigned seed) {
    std::mt19937 rng(seed);
    std::normal_distribution<double> normal(0, scene.noise);
    for (auto* plane : {&light_, &blue_, &red_}) plane->resize(width * height);
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        double rgb[3];
        mix(scene, u, v, rgb);
        const double luma = 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];
        const auto at = static_cast<std::size_t>(v * width + u);
        const auto byte = [](double value) {
          return static_cast<std::uint8_t>(std::clamp(std::lround(value), 0L, 255L));
        };
        light_[at] = byte(luma + normal(rng));
        blue_[at] = byte(128 + 0.564 * (rgb[2] - luma) + normal(rng));
        red_[at] = byte(128 + 0.713 * (rgb[0] - luma) + normal(rng));
      }
    }
    return view();
  }

  // The last picture moved by whole pixels, cyclically; mirrored from left to right before that.
  Picture moved(int right, int down, bool is_mirrored = false) {
    for (auto* plane : {&light_, &blue_, &red_}) {
      const std::vector<std::uint8_t> before = *plane;
      for (int v = 0; v < height; ++v) {
        for (int u = 0; u < width; ++u) {
          const int from_u = ((u - right) % width + width) % width, from_v = ((v - down) % height + height) % height;
          (*plane)[static_cast<std::size_t>(v * width + u)] =
              before[static_cast<std::size_t>(from_v * width + (is_mirrored ? width - 1 - from_u : from_u))];
        }
      }
    }
    return view();
  }

 private:
  static double grey(double x) { return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055; }

  static void mix(const DiscScene& scene, int u, int v, double* rgb) {
    const double cover = scene.pillar_from >= 0 && u >= scene.pillar_from ? 0.0 : covered(scene, u, v);
    const double room = scene.light * (0.18 + 0.05 * std::sin(0.13 * u) + 0.04 * std::cos(0.21 * v));
    const double x = (u - scene.centre.x()) / scene.radius_px, y = (v - scene.centre.y()) / scene.radius_px;
    const double z = std::sqrt(std::max(0.0, 1 - x * x - y * y));
    const double lit = 1 + 0.3 * x - 0.2 * y + scene.bent * (x + y) * z;  // from one side
    const double glint = scene.glint * std::exp(-18 * ((x - 0.6) * (x - 0.6) + (y + 0.5) * (y + 0.5)));
    const double object[3] = {0.10, 0.45, 0.03}, behind[3] = {1.04 * room, room, 0.92 * room};
    const double finger[3] = {0.22, 0.42, 0.05};
    const bool is_finger = scene.has_disc && scene.finger_from >= 0 && u >= scene.finger_from;
    for (int c = 0; c < 3; ++c) {
      const double light = is_finger ? finger[c] : cover * (lit * object[c] + glint) + (1 - cover) * behind[c];
      rgb[c] = 255 * grey(std::clamp(scene.gain * light, 0.0, 1.0));
    }
  }

  // Share of a normal distribution, `away` pixels from the centre, that lies within the disc.
  static double blurred(const DiscScene& scene, double away) {
    constexpr int chords = 200;
    const double r = scene.radius_px, s = scene.blur_px, step = 2 * r / chords;
    double sum = 0;
    for (int i = 0; i < chords; ++i) {
      const double y = -r + (i + 0.5) * step, off = (y - away) / s;
      sum += std::exp(-0.5 * off * off) * std::erf(std::sqrt(r * r - y * y) / (s * std::sqrt(2.0)));
    }
    return sum * step / (s * std::sqrt(2 * 3.14159265358979));
  }

  static double covered(const DiscScene& scene, int u, int v) {
    if (!scene.has_disc) return 0;
    const double centre_u = scene.centre.x() + scene.shear_px * (v - scene.centre.y());
    const double nearest = std::hypot(u - centre_u, v - scene.centre.y()) - scene.radius_px;
    if (std::abs(nearest) > 6 * scene.blur_px + scene.smear_px) return nearest < 0 ? 1 : 0;
    if (scene.is_blurred_disc) return blurred(scene, nearest + scene.radius_px);
    const int moments = scene.smear_px > 0 ? 9 : 1;
    double sum = 0;
    for (int m = 0; m < moments; ++m) {
      const double along = ((m + 0.5) / moments - 0.5) * scene.smear_px;
      const double off = std::hypot(u - centre_u - along, v - scene.centre.y()) - scene.radius_px;
      sum += 0.5 * std::erfc(off / (scene.blur_px * std::sqrt(2.0)));
    }
    return sum / moments;
  }

  Picture view() const {
    Picture out;
    out.width = width, out.height = height;
    out.light = {light_.data(), width, 1};
    out.blue = {blue_.data(), width, 1};
    out.red = {red_.data(), width, 1};
    return out;
  }

  std::vector<std::uint8_t> light_, blue_, red_;
};

}  // namespace huetrack::outline
