// The output that names the mistakes that tracks show: swapped videos, a late camera, a camera that was turned, another
// room's rig, a wrong radius or colour. Each is logged once, and a warning as long as it lasts.
#pragma once

#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/output.h"

namespace huetrack::reports {

class MistakeReport final : public pipeline::Output {
 public:
  explicit MistakeReport(const config::ServiceConfig& config);

  void on_set(const pipeline::TrackedSet& set) override;
  void on_config(const config::ServiceConfig& config) noexcept override;

  // In force now, one sentence each. thread-safe
  std::vector<std::string> warnings() const;
  // All that were named since the start, one sentence each, with the time since the first set. When the road is empty.
  std::vector<std::string> summary() const;
  // Was there one that says which camera is wrong, or that the rig is? Then a search had no chance, whatever it found.
  bool has_explained_rig() const { return has_explained_rig_; }

 private:
  std::vector<std::string> cameras_;
  std::optional<capture::Timestamp> first_at_;  // the tracking thread's
  struct Named {
    double at_s;
    std::string sentence;  // the latest
  };

  std::map<std::string, Named> ever_;  // guarded by mutex_; by target, kind and cameras
  bool has_explained_rig_ = false;
  std::vector<std::string> order_;  // the tracking thread's; the keys of ever_ as they came
  mutable std::mutex mutex_;
  std::vector<object_tracking::TargetOptions> targets_;  // guarded by mutex_
  std::vector<std::string> warnings_;                    // guarded by mutex_
};

}  // namespace huetrack::reports
