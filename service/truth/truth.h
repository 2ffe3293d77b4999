// A known truth: where targets really were, from a file, and what it says about an estimate.
#pragma once

#include <Eigen/Core>
#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace huetrack::truth {

using Timestamp = std::chrono::sys_time<std::chrono::nanoseconds>;  // on the recording's clock, as capture::Timestamp

// Where targets really were, on the recording's clock. Immutable.
class Truth {
 public:
  // CSV with the columns ball or target (the target's name; without it they are all of one, whose name is empty), t
  // (seconds), x, y, z (metres); others are ignored. A row whose x, y and z are nan says nothing: so a track of ours,
  // which has such rows while it is searching, can be what another one is compared with. throws ConfigError
  static Truth read(const std::filesystem::path& file);

  struct Sample {
    Timestamp at;
    Eigen::Vector3d position;
  };
  const std::map<std::string, std::vector<Sample>, std::less<>>& targets() const { return targets_; }  // by time

  // Makes the truth that of these targets: the only ball takes the name of the only target when their names differ.
  // Returns what to tell the user, one sentence each: that, or which targets have no truth and which balls there are.
  std::vector<std::string> match(std::span<const std::string> targets);

  // Moves all of it to a clock that is ahead of the file's by this much.
  void shift(std::chrono::nanoseconds ahead);

  // Linear between samples that are at most 0.1 s apart; nullopt outside them and for an unknown target.
  std::optional<Eigen::Vector3d> position(std::string_view target, Timestamp at) const;

 private:
  std::map<std::string, std::vector<Sample>, std::less<>> targets_;
};

// The normalised estimation error squared, e^T C^-1 e; infinity when C is not a covariance (not positive definite).
double nees(const Eigen::Vector3d& error_m, const Eigen::Matrix3d& covariance);

}  // namespace huetrack::truth
