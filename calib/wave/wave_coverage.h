// Progress of a wave while it is recorded: what each camera has seen, and what is missing.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/wave/ball_finder.h"

namespace huetrack::wave {

// thread-compatible. Regions that do not move are ignored: they may be static clutter of the ball's colour.
class WaveCoverage {
 public:
  static constexpr int columns = 6, rows = 4;   // cells of the image, as for a board's views
  static constexpr int enough_sightings = 150;  // per camera: five seconds at 30 Hz
  static constexpr int enough_shared = 40;      // moments that both cameras of a pair saw
  static constexpr double enough_image = 0.5;   // share of the cells
  static constexpr double enough_deep = 1.5;    // largest over smallest radius of a region: near and far

  struct OfCamera {
    int frames = 0, sightings = 0;  // sightings: frames in which the ball has moved
    std::array<int, columns * rows> parts{};
    double smallest_px = 0, largest_px = 0;  // radius; 10 % and 90 % quantiles
    bool is_seen_now = false;                // within the last 0.3 s
    double image_share() const;
    double depth() const;  // largest over smallest; 1: none
  };

  explicit WaveCoverage(const calib::CameraRig& rig);

  void add(const BallFrame& frame, std::size_t ball = 0);  // ball: which one, where several are waved

  std::vector<OfCamera> cameras() const;
  int shared(std::size_t a, std::size_t b) const { return shared_[std::min(a, b) * names_.size() + std::max(a, b)]; }

  std::vector<std::string> needs() const;  // missing parts, most important first, one sentence each; empty: enough
  std::string text() const;                // one terminal line: coverage per camera, and pairs that lack shared moments

 private:
  struct PerCamera {
    OfCamera counted;
    std::vector<std::vector<Eigen::Vector2d>> before;  // per ball: regions of its last frame
    std::vector<float> radii_px;
    double seen_at_s = -1e9, newest_s = -1e9;
  };
  std::vector<std::string> names_;
  std::vector<calib::ImageSize> sizes_;
  std::vector<PerCamera> cameras_;
  std::vector<int> shared_;  // per pair
};

}  // namespace huetrack::wave
