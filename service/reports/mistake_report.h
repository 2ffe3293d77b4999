// The output that reports setup mistakes found in the tracks: swapped videos, a late or turned camera, another room's
// rig, a wrong radius or colour. Each is logged once and is a warning while it lasts.
#pragma once

#include <atomic>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/output.h"

namespace huetrack::reports {

class MistakeReport final : public pipeline::Output {
 public:
  // is_recorded: the advice is about files and videos; otherwise about cameras
  MistakeReport(const config::ServiceConfig& config, bool is_recorded);

  void on_set(const pipeline::TrackedSet& set) override;
  void on_config(const config::ServiceConfig& config) noexcept override;

  // In force now, one sentence each. thread-safe
  std::vector<std::string> warnings() const;
  // All mistakes since the start, one sentence each, with the time since the first set. After the run.
  // are_times_contradicted: the recording's files do; time stamps come before the calibration then
  std::vector<std::string> summary(bool are_times_contradicted = false) const;
  // Since the start: a measured radius means nothing then (radius_advice.h). thread-safe
  bool do_views_contradict() const { return has_rig_mistake_ || has_moved_; }
  // A mistake explains that the search could not succeed: a camera or the rig is wrong. After the run.
  bool has_explained_rig() const { return has_explained_rig_; }

 private:
  struct Named {
    double at_s;
    std::string sentence;  // the latest
    view_watch::Mistake mistake;
    std::size_t target = 0;
    bool is_radius() const { return mistake.kind == view_watch::MistakeKind::radius; }
  };

  struct Span {                         // of a camera's frames
    std::uint32_t first = 0, last = 0;  // numbers
    capture::Timestamp first_at{}, last_at{};
  };
  void note_frames(const capture::FrameSet& frames);
  double frames_per_second(std::size_t camera) const;  // 0: unknown

  const bool is_recorded_;
  std::vector<Span> spans_;  // the tracking thread's
  std::vector<std::string> cameras_;
  std::optional<capture::Timestamp> first_at_;  // the tracking thread's
  std::map<std::string, Named> ever_;           // guarded by mutex_; by target, kind and cameras
  bool has_explained_rig_ = false;
  bool have_times_been_named_ = false;  // guarded by mutex_
  std::atomic<bool> has_rig_mistake_ = false;
  std::atomic<bool> has_moved_ = false;  // a camera, since a known moment: what was measured before holds
  std::vector<std::string> order_;       // the tracking thread's; keys of ever_ in order of appearance
  mutable std::mutex mutex_;
  std::vector<object_tracking::TargetOptions> targets_;  // guarded by mutex_
  std::vector<std::string> warnings_;                    // guarded by mutex_
};

}  // namespace huetrack::reports
