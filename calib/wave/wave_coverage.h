// What a wave still lacks while it is made: for people who wave the ball.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/wave/ball_finder.h"

namespace huetrack::wave {

// thread-compatible. What rests counts nothing, here as in the calibration: it may be furniture of the ball's colour.
class WaveCoverage {
 public:
  static constexpr int columns = 6, rows = 4;                     // parts of the image, as of a board's views
  static constexpr int enough_sightings = 150;                    // of a camera: five seconds at 30 Hz
  static constexpr int enough_shared = 40;                        // moments that both cameras of a pair saw
  static constexpr double enough_image = 0.5, enough_deep = 1.5;  // of its parts; of the largest region's radius to the
                                                                  // smallest's: near and far

  struct OfCamera {
    int frames = 0, sightings = 0;  // sightings: frames in which it has moved
    std::array<int, columns * rows> parts{};
    double smallest_px = 0, largest_px = 0;  // radius; all but the outermost tenths
    bool is_seen_now = false;                // in the last frames
    double image_share() const;
    double depth() const;  // largest over smallest; 1: of none
  };

  explicit WaveCoverage(const calib::CameraRig& rig);

  // ball: which one it is of, where several are waved.
  void add(const BallFrame& frame, std::size_t ball = 0);

  std::vector<OfCamera> cameras() const;
  int shared(std::size_t a, std::size_t b) const { return shared_[std::min(a, b) * names_.size() + std::max(a, b)]; }

  // What is missing, the most important first; a sentence each. Empty: it is enough.
  std::vector<std::string> needs() const;
  std::string text() const;  // for a line of a terminal: how much of each picture, and which pairs lack shared moments

 private:
  struct PerCamera {
    OfCamera told;
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
