// Tracks held to a known truth: what `huetrackd replay --truth` and `huetrackd compare` print, and the tests check.
#pragma once

#include <optional>
#include <string>

#include "object_tracking/object_estimate.h"
#include "truth/clock_offset.h"
#include "truth/truth.h"

namespace huetrack::tracks {

using truth::nees;
using truth::Truth;

// How well one target's track fits the truth. "After lock": from the locking set on, every set with a position.
struct TruthFigures {
  std::size_t sets = 0;                 // with a truth
  std::optional<std::size_t> lock_set;  // first of them (1 = the first) that is tracking and within 50 mm
  double lock_s = 0;                    // capture time from the first set to that one
  std::size_t samples = 0;              // after lock
  double rms_m = 0, max_m = 0;          // error of the position, after lock
  std::size_t wrong_tracking = 0;       // sets, from the first on, that say tracking and are over 10 cm off
  double mean_nees = 0;                 // after lock; 3 when the covariance is perfect
  double share_inside_95 = 0;           // of the samples after lock whose truth is inside the 95 % ellipsoid
};

// thread-compatible.
class TruthComparison {
 public:
  TruthComparison(const Truth& truth, std::string target) : truth_(&truth), target_(std::move(target)) {}

  // In time order. Returns the error in metres when there are both a position and a truth.
  std::optional<double> add(const object_tracking::ObjectEstimate& estimate);
  TruthFigures figures() const;
  // Of the sets that are tracking.
  std::optional<truth::TrackOffset> clock_offset() const {
    return truth::explaining_offset(*truth_, target_, tracking_.kept());
  }
  const std::string& target() const { return target_; }

 private:
  const Truth* truth_;
  std::string target_;
  TruthFigures sums_;  // rms_m, mean_nees, share_inside_95 hold sums until figures() divides them
  std::optional<capture::Timestamp> first_at_;
  truth::EstimatedSample tracking_;
};

// One readable line.
std::string to_text(const TruthFigures& figures);

}  // namespace huetrack::tracks
