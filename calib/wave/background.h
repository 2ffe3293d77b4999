// What stands still behind the ball, as each camera sees it.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "capture/frames/frame.h"
#include "outline/background.h"

namespace huetrack::wave {

// Light (0 is black) and chroma (blue, red; 0 is grey) of a pixel, in grey values of the full range.
Eigen::Vector3f light_at(const capture::Image& image, int u, int v);

struct BackgroundImage {
  int width = 0, height = 0;
  std::vector<Eigen::Vector3f> light;               // row by row
  Eigen::Vector3f noise = Eigen::Vector3f::Ones();  // of a single frame, per channel; standard deviation, at least 1

  const Eigen::Vector3f& at(int u, int v) const {
    return light[static_cast<std::size_t>(v) * static_cast<std::size_t>(width) + static_cast<std::size_t>(u)];
  }
};

struct CameraBackground {
  BackgroundImage mean;
  outline::Background behind;  // the same for fits
};

// Keeps copies of a few frames of each camera, spread over all that it was given. thread-compatible.
class BackgroundSamples {
 public:
  explicit BackgroundSamples(std::size_t camera_count) : of_camera_(camera_count) {}

  // Damaged frames, and such as differ in size from those before, are left out.
  void add(const capture::Frame& frame);

  // What most samples show: in each pixel the mean of the middle ones. nullopt: fewer than 8 samples.
  std::optional<CameraBackground> of(std::size_t camera) const;

 private:
  struct PerCamera {
    std::vector<capture::Image> samples;  // fewer than 24: a camera of 1920x1080 takes up to 100 MB
    std::size_t every = 1, seen = 0;
  };
  std::vector<PerCamera> of_camera_;
};

}  // namespace huetrack::wave
