// The output that says what light does: where an object's colour wanders in a camera, and where a camera's picture
// flickers or its automatics work. Each is a warning as long as it lasts.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "capture/frames/light_watch.h"
#include "pipeline/output.h"

namespace huetrack::reports {

class LightReport final : public pipeline::Output {
 public:
  // What is new goes into the log, too. is_recorded: what pictures show is done, and nobody can set a camera any more:
  // no warning, then, but in log and summary.
  LightReport(const config::ServiceConfig& config, bool is_recorded);

  void on_frame(const capture::Frame& frame, capture::Timestamp received_at) override;
  void on_set(const pipeline::TrackedSet& set) override;
  void on_config(const config::ServiceConfig& config) noexcept override;

  // In force now, one sentence each. thread-safe
  std::vector<std::string> warnings() const;

  // What there was since the start, in one sentence for all cameras' pictures and one for each target, whose colour is
  // told with the time since the first set; all of it stands in the log. When the road is empty.
  std::vector<std::string> summary() const;
  // A target's colour was beyond what is looked for, in some camera. When the road is empty.
  bool has_lost_color() const { return has_lost_color_; }

 private:
  struct Told {
    std::uint64_t news = 0;
    std::vector<std::string> warnings = {};  // per camera of the rig; empty: none
    struct Warning {
      std::string kind;  // without its numbers
      std::string sentence;
      std::size_t camera;
    };
    std::vector<Warning> ever = {};
    std::vector<std::string> followed = {};
  };
  std::string brief_of_pictures() const;
  void tell_colors(std::size_t target, const pipeline::TrackedSet& set);

  const std::vector<std::string> cameras_;
  const bool is_recorded_;
  std::vector<capture::LightWatch> watches_;          // the capture threads', one at a time
  std::vector<std::vector<std::string>> of_cameras_;  // the capture threads'; per camera, all that there were
  std::vector<std::vector<std::string>> briefs_;      // the capture threads'; per camera, each once
  std::vector<Told> told_;                            // the tracking thread's; warnings are guarded by mutex_
  std::optional<capture::Timestamp> first_at_;        // the tracking thread's
  std::uint64_t sets_ = 0;                            // the tracking thread's
  bool has_lost_color_ = false;                       // the tracking thread's
  mutable std::mutex mutex_;
  std::vector<object_tracking::TargetOptions> targets_;    // guarded by mutex_
  std::vector<std::vector<std::string>> camera_warnings_;  // guarded by mutex_; per camera
};

}  // namespace huetrack::reports
