// Ground truth: the true positions of targets, from a file.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace huetrack::truth {

using Timestamp = std::chrono::sys_time<std::chrono::nanoseconds>;  // on the recording's clock, as capture::Timestamp

// True positions on the recording's clock.
class Truth {
 public:
  // CSV with the columns ball or target (name; optional for a single target, whose name is then empty), t (seconds; or
  // t_ms, t_us, t_ns, ...), x, y, z (metres); others are ignored. Rows with x, y and z nan are skipped, so that a track
  // file can serve as truth. Or an export of Motive, Vicon or Qualisys, or TUM (motion_capture.h). throws
  // files::ConfigError
  static Truth read(const std::filesystem::path& file);

  struct Sample {
    Timestamp at;
    Eigen::Vector3d position;
  };
  const std::map<std::string, std::vector<Sample>, std::less<>>& targets() const { return targets_; }  // by time

  // Assigns the truth to these targets: a single ball is renamed to a single target. counts: how many objects each
  // target has; empty: one. Returns sentences for the user: the renaming, or the targets without a truth.
  std::vector<std::string> match(std::span<const std::string> targets, std::span<const int> counts = {});

  // Names of the balls that are objects of a target with several: all, if it is the only target; else "swarm",
  // "swarm1", "swarm_1" of swarm.
  std::vector<std::string> objects_of(std::string_view target, bool is_only_target) const;

  // Gives objects of targets with several, "swarm_3", the truth of the ball to which each is next, within 10 cm, most
  // often; one with a ball's name has that ball's. Returns one sentence each, for the user.
  std::vector<std::string> assign(const std::map<std::string, std::vector<Sample>>& objects);

  // Where the truth can hardly be of a track from first to last (on the truth's clock) in that room: other times or
  // units. One sentence each, for the user.
  std::vector<std::string> contradictions(Timestamp first, Timestamp last, const Eigen::AlignedBox3d& room) const;

  // Why nothing can be compared with tracks of these targets from first to last: both times, and the option to set.
  // is_shifted: --clock-offset was given. One of the targets has a truth.
  std::string apart_text(std::span<const std::string> targets, Timestamp first, Timestamp last, bool is_shifted) const;

  // Applies it to every position.
  void transform(const std::function<void(Eigen::Vector3d& position)>& change);

  // Adds `ahead` to all times.
  void shift(std::chrono::nanoseconds ahead);

  // Linear between samples that are at most 0.1 s apart; nullopt outside them and for an unknown target.
  std::optional<Eigen::Vector3d> position(std::string_view target, Timestamp at) const;

 private:
  std::map<std::string, std::vector<Sample>, std::less<>> targets_;
};

// A position that is farther from the truth is another object's.
inline constexpr double wrong_beyond_m = 0.10;

// Of an object "ball_3" of a target with several: ball; of other names the name.
std::string target_of(const std::string& name);

// Normalised estimation error squared (NEES), e^T C^-1 e; infinity if C is not positive definite.
double nees(const Eigen::Vector3d& error_m, const Eigen::Matrix3d& covariance);

}  // namespace huetrack::truth
