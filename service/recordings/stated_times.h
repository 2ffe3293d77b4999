// What a recording.yaml states of a camera's times, compared with what the camera's file says itself. Pure but for
// GivenRate. Private to this module.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "capture/frames/frame.h"
#include "recordings/recording.h"

namespace huetrack::recordings {

struct TimesProblem {
  std::string text;         // "its times are 0.0005556 s a frame, but ...: they look like minutes: ..."
  bool is_of_unit = false;  // another unit explains it: the times are wrong
};

// Listed times (camera.timestamps) that are too far apart, or too close, for the file. file_period: by its header; 0:
// it has none, as images. nullopt: they may be right.
std::optional<TimesProblem> problem_of_listed_times(const RecordedCamera& camera, capture::Duration file_period);

// A given rate (fps) beside a film's own time stamps. thread-compatible.
class GivenRate {
 public:
  GivenRate(double fps, capture::Duration file_period) : fps_(fps), file_period_(file_period) {}

  // The next picture's place in the stream, and its time by the container.
  void see(std::int64_t index, capture::Timestamp stamp);
  // Contradictions since the last call, as "fps says 25, but ...".
  std::vector<std::string> take_problems();

 private:
  using Seen = std::pair<std::int64_t, capture::Timestamp>;
  void compare_rates(const Seen& picture);
  void look_for_gap();

  double fps_;
  capture::Duration file_period_;
  std::optional<Seen> first_;
  std::deque<Seen> recent_;
  bool has_compared_ = false, has_problem_ = false;
  std::vector<std::string> problems_;
};

}  // namespace huetrack::recordings
