// The output that says when the cameras' rows are exposed, as the targets' motion tells it, and writes it into a rig.
#pragma once

#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/output.h"
#include "reports/rig_report.h"

namespace huetrack::reports {

class CameraTimes final : public pipeline::Output {
 public:
  // is_logging: what has become known, and what has changed since it was said, goes into the log. rig_file: written
  // when the road is empty, as the configuration's rig with the times of the cameras that became known (with `timing:
  // fixed` the rig's own, as nothing is learnt); empty: no file.
  // calibration: the rig is written with the cameras standing where it has found them; it outlives this. null: as they
  // stood. throws std::runtime_error when the file is there.
  CameraTimes(const config::ServiceConfig& config, std::filesystem::path rig_file, bool is_logging,
              const RigReport* calibration = nullptr);

  void on_set(const pipeline::TrackedSet& set) override;
  void on_config(const config::ServiceConfig& config) noexcept override;
  void flush() override;  // throws std::system_error

  // While an object moves and the cameras' times are not known: one sentence. thread-safe
  std::vector<std::string> warnings() const;
  // As they are believed now, one per camera of the rig; empty: nothing is known yet. thread-safe
  std::vector<object_tracking::CameraTimingEstimate> told() const;
  // One sentence per camera. When the road is empty.
  std::vector<std::string> summary() const;
  // When the road is empty.
  calib::CameraRig rig() const;

 private:
  using Estimates = std::vector<object_tracking::CameraTimingEstimate>;  // per camera of the rig
  void tell(const Estimates& told);

  const std::filesystem::path rig_file_;
  const bool is_logging_;
  const RigReport* const calibration_;
  calib::CameraRig rig_;
  Estimates times_;   // the tracking thread's, and guarded by mutex_ for who reads it on another
  Estimates logged_;  // the tracking thread's; with the sigma of what was not logged yet at infinity
  mutable std::mutex mutex_;
  std::optional<std::string> open_;  // guarded by mutex_
  bool is_learning_ = false;         // guarded by mutex_
};

}  // namespace huetrack::reports
