// The output that reports objects that appear and end (targets with `count`), one object too many, static clutter of a
// target's colour, two targets on one object, and remote cameras that match other colours than a target's.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/output.h"
#include "reports/tracked_sets.h"

namespace huetrack::reports {

class ObjectReport final : public pipeline::Output {
 public:
  // New findings are also logged.
  explicit ObjectReport(const config::ServiceConfig& config);

  void on_set(const pipeline::TrackedSet& set) override;
  void on_config(const config::ServiceConfig& config) noexcept override;

  // In force now, one sentence each. thread-safe
  std::vector<std::string> warnings() const;
  // The last sentence of each finding since the start; the certainty is the caller's, of the whole run. After the run.
  std::vector<std::string> summary() const { return all(&Finding::ever); }

 private:
  struct Object {
    capture::Timestamp since{};
    Eigen::Vector3d last = Eigen::Vector3d::Zero();
  };
  // A finding that comes and goes; empty sentences: none.
  struct Finding {
    std::string now, ever;
    void set(std::string sentence, const std::string& when_gone);  // logs the change
  };
  struct Target {
    std::map<std::uint32_t, Object> objects = {};  // alive, by number
    std::vector<Finding> clutter = {};             // per camera of the rig
    Finding extra_object = {};
    Finding shared_place = {};                  // with a later target
    std::optional<double> shown_radius_m = {};  // the tracking thread's; ObjectTracker's
    TrackedSets tracked;                        // of the window that goes on; a changed target begins one
    Finding is_unsure = {};
    std::vector<std::uint64_t> frames_of_others = {};  // per camera: frames without this colour, at the last check
    std::vector<int> bad_checks = {};                  // per camera: consecutive checks with mostly such frames
    std::vector<Finding> other_colors = {};            // per camera
  };
  void log_objects(const pipeline::TrackedSet& set);
  void check_clutter(const pipeline::TrackedSet& set);
  void check_radius(const pipeline::TrackedSet& set);
  void check_extra_objects(const pipeline::TrackedSet& set);
  void check_other_colors(const pipeline::TrackedSet& set);
  void check_shared_places(const pipeline::TrackedSet& set);
  void check_certainty(const pipeline::TrackedSet& set);
  bool may_log(capture::Timestamp at);
  std::vector<std::string> all(std::string Finding::*which) const;

  const std::vector<std::string> cameras_;
  std::vector<Target> targets_;  // the tracking thread's; all but `objects` guarded by mutex_
  // Consecutive sets in which two targets are tracked at one place. guarded by mutex_
  std::map<std::pair<std::size_t, std::size_t>, std::uint64_t> together_;
  std::uint64_t sets_ = 0;           // the tracking thread's
  capture::Timestamp log_since_{};   // the tracking thread's
  int logged_ = 0, suppressed_ = 0;  // the tracking thread's; since log_since_
  mutable std::mutex mutex_;
  std::vector<object_tracking::TargetOptions> options_;  // guarded by mutex_
};

// "left: 1.9 % of the picture has the colour of orange and never moves, most of it around 210, 40 ..."; empty if it is
// negligible.
std::string clutter_text(const std::string& camera, const std::string& target,
                         const object_tracking::ColorShare& share);

// "left: its frames hold matches of other colours, none for lime: ...".
std::string other_colors_text(const std::string& camera, const std::string& target);

// "ball: something else has its colour and its size, at 0.31, 0.12, 1.10 m: ...".
std::string extra_object_text(const object_tracking::TargetOptions& target, const Eigen::Vector3d& at);

// "lime and green are tracked at the same place: ...".
std::string shared_place_text(const std::string& target, const std::string& other);

}  // namespace huetrack::reports
