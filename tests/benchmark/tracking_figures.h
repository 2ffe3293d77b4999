// How well a tracker does on a sequence with known truth.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "benchmark/sequence.h"
#include "object_tracking/object_estimate.h"

namespace huetrack::figures {

struct TrackingFigures {
  std::optional<std::size_t> lock_set;  // 1 = the first; first in `tracking` within 50 mm of the truth
  std::size_t sets = 0;                 // all
  std::size_t without_answer = 0;       // of all: no position
  std::size_t compared = 0;             // with a position, from the lock on
  double rms_m = 0, max_m = 0;          // of those
  std::size_t seen_by_two = 0;          // of those: two or more views see more than half of the ball
  double rms_two_views_m = 0, max_two_views_m = 0;
  std::size_t wrong_tracking = 0;  // of all: `tracking` and over 10 cm off
  std::size_t longest_return = 0;  // frame sets from being visible in two views to `tracking`, the longest
  double largest_jump_m = 0;       // error's change between two sets on end that both have a position, at most two
                                   // views of which see the ball
  double mean_nees = 0, share_inside_95 = 0;  // of `compared`; 3 and 0.95 when the covariance is perfect
  // The figures by how many views see more than half of the ball: none, one, two or more.
  struct Seen {
    std::size_t sets = 0, compared = 0, inside_95 = 0,
                tracking = 0;  // of all; with a position; of those; saying `tracking`
    double sum_error2 = 0, sum_nees = 0, max_m = 0;
  };
  std::array<Seen, 3> by_views;
};

std::vector<object_tracking::ObjectEstimate> track(const Sequence& sequence,
                                                   const object_tracking::TargetOptions& target,
                                                   const object_tracking::ObjectTrackerOptions& options);
// from_s: what comes earlier after the first set is left out.
TrackingFigures figures_of(const Sequence& sequence, const std::string& target,
                           const std::vector<object_tracking::ObjectEstimate>& track, double from_s = 0);

// The blob's positions as if they were estimates in `tracking`, so that one function judges both; no covariance.
std::vector<object_tracking::ObjectEstimate> track_blob(const Sequence& sequence,
                                                        const object_tracking::TargetOptions& target);

// Frame sets whose estimate projects inside the red square in both views: inside the convex hull of the largest red
// region.
std::size_t inside_red_square(const Sequence& sequence, const std::vector<object_tracking::ObjectEstimate>& track);

}  // namespace huetrack::figures
