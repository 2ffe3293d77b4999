// Tracks held to a known truth: what `huetrackd replay --truth` and `huetrackd compare` print, and the tests check.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "object_tracking/object_estimate.h"

namespace huetrack::tracks {

// Where targets really were, on the recording's clock. Immutable.
class Truth {
 public:
  // CSV with the columns ball (the target's name), t (seconds), x, y, z (metres); others are ignored. throws
  // ConfigError
  static Truth read(const std::filesystem::path& file);

  struct Sample {
    capture::Timestamp at;
    Eigen::Vector3d position;
  };
  const std::map<std::string, std::vector<Sample>, std::less<>>& targets() const { return targets_; }  // by time

  // Makes the truth that of these targets: the only ball takes the name of the only target when their names differ.
  // Returns what to tell the user, one sentence each: that, or which targets have no truth and which balls there are.
  std::vector<std::string> match(std::span<const std::string> targets);

  // Linear between samples that are at most 0.1 s apart; nullopt outside them and for an unknown target.
  std::optional<Eigen::Vector3d> position(std::string_view target, capture::Timestamp at) const;

 private:
  std::map<std::string, std::vector<Sample>, std::less<>> targets_;
};

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
  const std::string& target() const { return target_; }

 private:
  const Truth* truth_;
  std::string target_;
  TruthFigures sums_;  // rms_m, mean_nees, share_inside_95 hold sums until figures() divides them
  std::optional<capture::Timestamp> first_at_;
};

// The normalised estimation error squared, e^T C^-1 e; infinity when C is not a covariance (not positive definite).
double nees(const Eigen::Vector3d& error_m, const Eigen::Matrix3d& covariance);

// One readable line.
std::string to_text(const TruthFigures& figures);

}  // namespace huetrack::tracks
