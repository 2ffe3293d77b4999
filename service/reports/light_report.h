// The output that reports effects of light: a target's colour that drifts in a camera; flicker, automatic exposure and
// automatic white balance in a camera's pictures. Each is a warning while it lasts.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "capture/frames/light_watch.h"
#include "pipeline/output.h"

namespace huetrack::reports {

class LightReport final : public pipeline::Output {
 public:
  // New findings are also logged, those about pictures for the first camera that has them. is_recorded: cameras cannot
  // be adjusted any more, so findings about pictures are in the log and the summary but are no warnings.
  LightReport(const config::ServiceConfig& config, bool is_recorded);

  void on_frame(const capture::Frame& frame, capture::Timestamp received_at) override;
  void on_set(const pipeline::TrackedSet& set) override;
  void on_config(const config::ServiceConfig& config) noexcept override;

  // In force now, one sentence each. thread-safe
  std::vector<std::string> warnings() const;

  // Everything since the start, shortened: one sentence for all cameras' pictures and one per target, with the time
  // since the first set. The log has it all. After the run.
  std::vector<std::string> summary() const;
  // A target's colour left its range in some camera. After the run.
  bool has_lost_color() const { return has_lost_color_; }

 private:
  struct TargetColors {
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
  std::string pictures_summary() const;
  void report_colors(std::size_t target, const pipeline::TrackedSet& set);

  const std::vector<std::string> cameras_;
  const bool is_recorded_;
  std::vector<bool> has_controls_;                // per camera; false: the camera has its own program for them
  std::vector<capture::LightWatch> watches_;      // the capture threads', one at a time
  std::set<std::string> logged_;                  // the capture threads'; without numbers and camera
  std::vector<std::vector<std::string>> briefs_;  // the capture threads'; per camera, each once
  std::vector<TargetColors> colors_;              // the tracking thread's; warnings are guarded by mutex_
  std::optional<capture::Timestamp> first_at_;    // the tracking thread's
  std::uint64_t sets_ = 0;                        // the tracking thread's
  bool has_lost_color_ = false;                   // the tracking thread's
  mutable std::mutex mutex_;
  std::vector<object_tracking::TargetOptions> targets_;    // guarded by mutex_
  std::vector<std::vector<std::string>> camera_warnings_;  // guarded by mutex_; per camera
};

}  // namespace huetrack::reports
