// Detects a constant offset between the clock of a track and that of its ground truth: such a track has errors of the
// object's velocity times the offset. Pure.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "truth/truth.h"

namespace huetrack::truth {

// One estimate of a track.
struct Estimated {
  Timestamp at;
  Eigen::Vector3d position;
  Eigen::Matrix3d covariance;
};

struct TrackOffset {
  double offset_s = 0;                  // the track's clock minus the truth's
  double rms_m = 0, rms_without_m = 0;  // of the errors, with and without the offset
  double mean_nees = 0;                 // with the offset; 3: consistent
};

// The offset of at most 0.5 s that explains most of the error: with it the rms error is less than half, and the errors
// are consistent with the covariances. nullopt: none, or too few estimates. estimates: of state tracking, in any order.
std::optional<TrackOffset> explaining_offset(const Truth& truth, std::string_view target,
                                             std::span<const Estimated> estimates);

// A subsample of at most 4000 estimates, spread over the whole track. thread-compatible.
class EstimatedSample {
 public:
  void add(const Estimated& estimate);
  std::span<const Estimated> kept() const { return kept_; }

 private:
  std::vector<Estimated> kept_;
  std::size_t every_ = 1, seen_ = 0;
};

}  // namespace huetrack::truth
