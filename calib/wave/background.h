// Static background of each camera.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "capture/frames/frame.h"

namespace huetrack::wave {

// Luma (0: black) and chroma (blue, red; 0: grey) of a pixel, full range.
Eigen::Vector3f light_at(const capture::Image& image, int u, int v);

struct BackgroundImage {
  int width = 0, height = 0;
  std::vector<Eigen::Vector3f> light;               // row by row
  Eigen::Vector3f noise = Eigen::Vector3f::Ones();  // standard deviation of one frame per channel, at least 1

  const Eigen::Vector3f& at(int u, int v) const {
    return light[static_cast<std::size_t>(v) * static_cast<std::size_t>(width) + static_cast<std::size_t>(u)];
  }
};

// Keeps copies of a few frames per camera, spread over all frames. thread-compatible.
class BackgroundSamples {
 public:
  explicit BackgroundSamples(std::size_t camera_count) : of_camera_(camera_count) {}

  // Skips corrupted frames, and frames of another size than the first.
  void add(const capture::Frame& frame);

  // Per pixel the mean of the middle half of the samples. nullopt: fewer than 8 samples.
  std::optional<BackgroundImage> of(std::size_t camera) const;

 private:
  struct PerCamera {
    std::vector<capture::Image> samples;  // < 24: up to 100 MB at 1920x1080
    std::size_t every = 1, seen = 0;
  };
  std::vector<PerCamera> of_camera_;
};

}  // namespace huetrack::wave
