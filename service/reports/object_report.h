// The output that says what comes and goes: the objects of targets that are several, each when it is found and when it
// ends; one more than there should be; what of a room has a target's colour, never moves, and is therefore left out;
// and cameras that say which pixels match other colours than a target's.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "pipeline/output.h"

namespace huetrack::reports {

class ObjectReport final : public pipeline::Output {
 public:
  // What is new goes into the log, too.
  explicit ObjectReport(const config::ServiceConfig& config);

  void on_set(const pipeline::TrackedSet& set) override;
  void on_config(const config::ServiceConfig& config) noexcept override;

  // What is left out, or one too many, now, one sentence each. thread-safe
  std::vector<std::string> warnings() const;
  // What was left out, or one too many, at any time, one sentence each. When the road is empty.
  std::vector<std::string> summary() const;

 private:
  struct Object {
    capture::Timestamp since{};
    Eigen::Vector3d last = Eigen::Vector3d::Zero();
  };
  // What is said of one thing that comes and goes: now, and the last time; empty: nothing.
  struct Told {
    std::string now, ever;
    void say(std::string sentence, const std::string& when_gone);  // the log has what is new
  };
  struct Target {
    std::map<std::uint32_t, Object> objects = {};  // that are there, by number
    std::vector<Told> left_out = {};               // per camera of the rig
    Told further = {};                             // what is one object too many
    std::vector<std::uint64_t> other_colors = {};  // per camera: frames that told nothing of it, at the last look
    std::vector<int> in_a_row = {};                // looks at which they were most
    std::vector<Told> untold = {};                 // per camera: what is said of that
  };
  void tell_objects(const pipeline::TrackedSet& set);
  void tell_left_out(const pipeline::TrackedSet& set);
  void tell_further(const pipeline::TrackedSet& set);
  void tell_other_colors(const pipeline::TrackedSet& set);
  bool may_tell(capture::Timestamp at);
  std::vector<std::string> all(std::string Told::*which) const;

  const std::vector<std::string> cameras_;
  std::vector<Target> targets_;      // the tracking thread's; but for `objects` guarded by mutex_
  std::uint64_t sets_ = 0;           // the tracking thread's
  capture::Timestamp told_since_{};  // the tracking thread's
  int told_ = 0, not_told_ = 0;      // the tracking thread's
  mutable std::mutex mutex_;
  std::vector<object_tracking::TargetOptions> options_;  // guarded by mutex_
};

// "left: 1.9 % of the picture has the colour of orange and never moves: around 210, 40, and is left out"; empty where
// that is not worth a word.
std::string left_out_text(const std::string& camera, const std::string& target,
                          const object_tracking::ColorShare& share);

// "left: its frames say which pixels match other colours than that of lime, ...".
std::string other_colors_text(const std::string& camera, const std::string& target);

// "ball: something else has its colour and its size, at 0.31, 0.12, 1.10 m: ...".
std::string further_text(const object_tracking::TargetOptions& target, const Eigen::Vector3d& at);

}  // namespace huetrack::reports
