// What white balance does to a picture: all colours turn. For tests that wander away from what was taught.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "capture/frames/frame.h"
#include "scene/scene.h"

namespace huetrack::scene {

// Three cameras around a ball that goes round a small circle once a second: a second of it can be played again and
// again.
inline Scene circling_ball() {
  return SceneBuilder{}
      .cameras_on_ring({.count = 3})
      .ball({.radius_m = 0.08,
             .path = [](double t) -> Eigen::Vector3d {
               const double angle = 2 * std::numbers::pi * t;
               return {0.1 * std::cos(angle), 0.1 * std::sin(angle), 1};
             }})
      .build();
}

// The same yuyv image with its chroma turned in the plane of u and v: by nearly as much in hue, and the same way round.
inline capture::Image turned_hue(const capture::Image& image, double degrees) {
  const capture::WritableImage out = capture::make_image(image.format, image.range, image.width, image.height);
  const double angle = degrees * std::numbers::pi / 180, cosine = std::cos(angle), sine = std::sin(angle);
  const auto byte = [](double value) {
    return static_cast<std::uint8_t>(std::lround(std::fmin(255, std::fmax(0, value))));
  };
  for (int v = 0; v < image.height; ++v) {
    const std::uint8_t* from = image.planes[0].data + v * image.planes[0].stride;
    std::uint8_t* to = out.data[0] + v * out.image.planes[0].stride;
    for (int i = 0; i < 2 * image.width; i += 4) {
      const double cb = from[i + 1] - 128, cr = from[i + 3] - 128;
      to[i] = from[i], to[i + 2] = from[i + 2];
      to[i + 1] = byte(128 + cosine * cb - sine * cr);
      to[i + 3] = byte(128 + sine * cb + cosine * cr);
    }
  }
  return out.image;
}

// One second of film, played as often as is asked for; frame k of `of_camera` (all where it is negative) is turned by
// degrees_at(t).
template <typename DegreesAt>
std::vector<capture::FrameSet> wandering(const std::vector<capture::FrameSet>& second, double fps, double seconds,
                                         DegreesAt degrees_at, int of_camera = -1) {
  std::vector<capture::FrameSet> film;
  for (std::size_t k = 0; static_cast<double>(k) < seconds * fps; ++k) {
    const double t = static_cast<double>(k) / fps;
    capture::FrameSet set = second[k % second.size()];
    set.number = k;
    set.at = capture::Timestamp(capture::duration_of(t));
    for (auto& frame : set.frames) {
      frame->sequence = static_cast<std::uint32_t>(k);
      frame->captured_at = frame->stamped_at = set.at;
      const double degrees = of_camera < 0 || of_camera == frame->camera ? degrees_at(t) : 0;
      if (degrees != 0) frame->pixels = turned_hue(frame->pixels, degrees);
    }
    film.push_back(std::move(set));
  }
  return film;
}

}  // namespace huetrack::scene
