// Compares tracks with a ground truth, for `huetrackd replay --truth`, `huetrackd compare` and tests.
#pragma once

#include <optional>
#include <string>

#include "object_tracking/object_estimate.h"
#include "truth/alignment.h"
#include "truth/truth.h"

namespace huetrack::tracks {

using truth::nees;
using truth::Truth;

// Errors of one target's track. "After lock": all sets with a position, from the locking set on.
struct TruthFigures {
  std::size_t sets = 0;                 // with a truth
  std::optional<std::size_t> lock_set;  // number of the first one, from 1, that is tracking and within 50 mm
  double lock_s = 0;                    // capture time from the first set to that one
  std::size_t samples = 0;              // after lock
  double rms_m = 0, max_m = 0;          // position error, after lock
  std::size_t tracking_samples = 0;     // of these samples: with state tracking
  double tracking_rms_m = 0;            // of those
  std::size_t wrong_tracking = 0;       // sets with state tracking and an error over 10 cm, before lock included
  double mean_nees = 0;                 // after lock; 3: consistent covariance
  double share_inside_95 = 0;           // of the samples after lock: truth inside the 95 % ellipsoid
};

// thread-compatible.
class TruthComparison {
 public:
  TruthComparison(const Truth& truth, std::string target) : truth_(&truth), target_(std::move(target)) {}

  // In time order. Returns the error in metres if there are a position and a truth.
  std::optional<double> add(const object_tracking::ObjectEstimate& estimate);
  TruthFigures figures() const;
  // Over the sets with state tracking.
  std::optional<truth::Explanation> explanation() const {
    const truth::TargetTrack track{target_, tracking_.kept()};
    return truth::explanation(*truth_, {&track, 1});
  }
  const std::string& target() const { return target_; }

 private:
  const Truth* truth_;
  std::string target_;
  TruthFigures sums_;  // rms_m, tracking_rms_m, mean_nees, share_inside_95: sums, divided in figures()
  std::optional<capture::Timestamp> first_at_;
  truth::EstimatedSample tracking_;
};

// One line for people.
std::string to_text(const TruthFigures& figures);

}  // namespace huetrack::tracks
