// The LED that the schedule lights in a frame, and the search for the schedule's offset.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "camera_tracking/camera_tracker.h"
#include "camera_tracking/leds/led_search.h"

namespace huetrack::leds {

using namespace camera_tracking;

// A frame's position in a schedule, by time or by count.
struct LedMoment {
  capture::Timestamp at;
  std::int64_t index = 0;  // of the frame in its camera's stream
};
LedMoment moment_of(const capture::Frame& frame);

// nullopt: no schedule; -1: no LED. offset: half slots by which the schedule is ahead of the configured one. By time, a
// slot begins 0.1 slots early, so that rounding does not matter for capture times that are multiples of the slot.
std::optional<int> lit_led(const LedStart& start, const LedMoment& moment, int offset = 0);

// Estimates the offset of a schedule that was not started together with the camera: tries all offsets on some
// sightings, one per frame. The offset must explain them at a quarter of the pixel noise of any other one (with a ring
// of LEDs, half a round may fit to some px). thread-compatible.
class LedOffsetSearch {
 public:
  LedOffsetSearch(const calib::Camera& camera, const LedStart& start, int particle_count, particle_filter::Rng rng);

  // Frames without a pose, in time order. dot: the brightest one. Returns the offset when it is unambiguous.
  std::optional<int> update(const LedMoment& moment, const std::optional<Eigen::Vector2d>& dot);
  void forget();

 private:
  struct TimedDot {
    LedMoment moment;
    Eigen::Vector2d px;
  };
  struct OffsetTrial {
    int offset;
    double margin;  // slots; least distance of a frame from its slot's borders
    std::vector<int> lit;
  };
  std::vector<OffsetTrial> trials() const;

  LedStart start_;
  LedSearch search_;
  std::deque<TimedDot> window_;
  std::vector<TimedDot> tried_on_;                    // empty: window_ is not full yet
  std::vector<OffsetTrial> untried_;                  // on tried_on_
  std::vector<std::pair<double, int>> explained_by_;  // LedSearch::noise_scale(), offset
};

}  // namespace huetrack::leds
