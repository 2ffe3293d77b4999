// Which LED the schedule lights in a frame, and where the schedule really begins.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "camera_tracking/camera_tracker.h"
#include "camera_tracking/leds/led_search.h"

namespace huetrack::leds {

// When a frame was taken, as a schedule counts.
struct LedMoment {
  capture::Timestamp at;
  std::int64_t index = 0;  // of the frame in its camera's stream
};
LedMoment moment_of(const capture::Frame& frame);

// nullopt: there is no schedule; -1: no LED. offset: half slots by which the schedule is ahead of what the
// configuration says. By time, a frame counts to the next slot from a tenth of a slot before its beginning on: capture
// times that are multiples of the slot must not fall to either side by their last digits.
std::optional<int> lit_led(const camera_tracking::LedStart& start, const LedMoment& moment, int offset = 0);

// The offset of a schedule whose beginning is not known: the LEDs' controller and the camera were not started together.
// Over some sightings all offsets are tried, a few per frame; the one by which a pose explains them counts, if by every
// other one the pixels would have to be four times as noisy (half way round a ring of LEDs a pose may fit to some px).
// thread-compatible.
class LedOffsetSearch {
 public:
  LedOffsetSearch(const calib::Camera& camera, const camera_tracking::LedStart& start, int particle_count,
                  particle_filter::Rng rng);

  // Of frames in time order that have no pose. dot: the brightest one. Returns the offset when it is clear.
  std::optional<int> update(const LedMoment& moment, const std::optional<Eigen::Vector2d>& dot);
  void forget();  // there is a pose: what was gathered is not needed

 private:
  struct TimedDot {
    LedMoment moment;
    Eigen::Vector2d px;
  };
  struct OffsetTrial {
    int offset;
    double margin;  // slots, from the frame that lies nearest to a slot's end
    std::vector<int> lit;
  };
  std::vector<OffsetTrial> trials() const;

  camera_tracking::LedStart start_;
  LedSearch search_;
  std::deque<TimedDot> window_;
  std::vector<TimedDot> tried_on_;                    // empty: the window is not full yet
  std::vector<OffsetTrial> untried_;                  // on tried_on_
  std::vector<std::pair<double, int>> explained_by_;  // LedSearch::noise_scale(), offset
};

}  // namespace huetrack::leds
