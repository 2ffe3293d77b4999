// The output that reports the cameras' timing (latency, readout) as estimated from the targets' motion, and writes it
// into a rig file.
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
  // is_logging: logs each camera's timing when it becomes known and when it changes significantly.
  // rig_file: written by flush() as the configuration's rig with the timing of the cameras for which it is known (with
  // `timing: fixed`, the rig's own timing); empty: no file.
  // calibration: supplies corrected poses for that file; outlives this; null: poses of the configuration.
  // throws std::runtime_error if rig_file exists.
  CameraTimes(const config::ServiceConfig& config, std::filesystem::path rig_file, bool is_logging,
              const RigReport* calibration = nullptr);

  void on_set(const pipeline::TrackedSet& set) override;
  void on_config(const config::ServiceConfig& config) noexcept override;
  void flush() override;  // throws std::system_error

  // At most one sentence, while an object moves and a camera's latency is unknown. thread-safe
  std::vector<std::string> warnings() const;
  // Current estimates, one per camera of the rig; empty: none yet. thread-safe
  std::vector<object_tracking::CameraTimingEstimate> timing() const;
  // One sentence per camera. After the run.
  std::vector<std::string> summary() const;
  // After the run.
  calib::CameraRig rig() const;

 private:
  using Estimates = std::vector<object_tracking::CameraTimingEstimate>;  // per camera of the rig
  void log_changes(const Estimates& now);
  void note_periods(const capture::FrameSet& frames);
  // timing_, as uncertain as the time stamps were found to vary, and as it is off what a camera can have.
  Estimates stated() const;

  const std::filesystem::path rig_file_;
  const bool is_logging_;
  const RigReport* const calibration_;
  calib::CameraRig rig_;
  Estimates timing_;              // written by the tracking thread; guarded by mutex_ for other readers
  std::vector<double> uneven_s_;  // written by the tracking thread; guarded by mutex_; per camera, by its mistakes
  struct Period {
    std::optional<capture::Timestamp> last = {};
    double mean_s = 0;
    int intervals = 0;
  };
  std::vector<Period> periods_;  // of frames; as uneven_s_
  Estimates logged_;             // the tracking thread's; latency sigma infinite: not logged yet
  mutable std::mutex mutex_;
  std::optional<std::string> warning_;  // guarded by mutex_
  bool is_learning_ = false;            // guarded by mutex_
};

}  // namespace huetrack::reports
