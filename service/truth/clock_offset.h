// A track that is right and on another clock than its truth looks as if it were off by the way that its object goes
// meanwhile. Pure.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "truth/truth.h"

namespace huetrack::truth {

// What a track says at one time.
struct Estimated {
  Timestamp at;
  Eigen::Vector3d position;
  Eigen::Matrix3d covariance;
};

struct TrackOffset {
  double offset_s = 0;                  // how far the track's clock is ahead of the truth's
  double rms_m = 0, rms_without_m = 0;  // of the errors, with it and as they are
  double mean_nees = 0;                 // with it; 3 when the covariance is perfect
};

// The one offset, of at most half a second, that makes most of the error: with it the rms error is less than half of
// what it is, and the errors are as large as the covariances say. nullopt: none does, or there are too few estimates.
// estimates: those that are sure, in any order.
std::optional<TrackOffset> explaining_offset(const Truth& truth, std::string_view target,
                                             std::span<const Estimated> estimates);

// For people, a sentence. given_s: the offset that is taken off already.
std::string to_text(const TrackOffset& offset, double given_s);

// Some thousand of a track's estimates, spread over all of it. thread-compatible.
class EstimatedSample {
 public:
  void add(const Estimated& estimate);
  std::span<const Estimated> kept() const { return kept_; }

 private:
  std::vector<Estimated> kept_;
  std::size_t every_ = 1, seen_ = 0;
};

}  // namespace huetrack::truth
