// Supervises a session on live cameras: log, status, metrics, service manager, reloads.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "daemon/status_reporter.h"
#include "metrics/metrics.h"
#include "metrics/pipeline_meter.h"
#include "pipeline/bus.h"
#include "pipeline/file_outputs.h"
#include "pipeline/live_cameras.h"
#include "pipeline/recording_keeper.h"
#include "pipeline/session.h"
#include "reports/reports.h"

namespace huetrack::daemon {

// Requests to a running service. thread-safe: set by signals and the page, cleared by the service.
struct LiveRequests {
  std::atomic<bool> reload = false;  // SIGHUP
  std::atomic<bool> save = false;    // SIGUSR1: the pre-roll
  // A new session with the current configuration (other targets), or for a recording.
  std::atomic<bool> restart = false;
  // A recording to replay once instead of the cameras; empty: none. Set it before restart.
  void open_recording(const std::filesystem::path& folder) {
    const std::scoped_lock lock(mutex_);
    recording_ = folder;
  }
  std::filesystem::path take_recording() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(recording_, {});
  }

 private:
  std::mutex mutex_;
  std::filesystem::path recording_;  // guarded by mutex_
};

// All of it outlives the supervisor.
struct Supervised {
  pipeline::Session& session;
  std::span<const pipeline::LiveCamera> cameras;
  LiveRequests& requests;
  const metrics::PipelineMeter& meter;
  const reports::Reports& reports;
  pipeline::RecordingKeeper& recording;
  std::vector<const pipeline::FileOutput*> files;
  pipeline::Bus* bus = nullptr;                      // null: nothing is published
  metrics::MetricsServer* metrics_server = nullptr;  // null: no endpoint
};

// thread-compatible. An output only to receive on_config().
class Supervisor final : public pipeline::Output {
 public:
  explicit Supervisor(Supervised supervised);

  // Every few tens of milliseconds, and once after the run.
  void poll() { check(false); }
  void poll_last() { check(true); }

  bool is_receiving() const;                                             // a camera has delivered
  const publish::ServiceStatus& last_status() const { return status_; }  // last published

  void on_config(const config::ServiceConfig& config) noexcept override { reporter_.take_over(config); }

 private:
  using Clock = std::chrono::steady_clock;
  struct Healths {
    std::vector<capture::CameraHealth> in_use;
    std::vector<std::optional<capture::CameraHealth>> by_rig;
  };

  void check(bool is_last);
  void reload_configuration();
  void apply_controls(const std::vector<config::LiveCameraConfig>& before);
  bool log_events();  // whether there were any
  Healths healths() const;
  void publish_status(const pipeline::PipelineFigures& figures, const Healths& cameras,
                      std::span<const metrics::TargetFigures> targets, Clock::time_point now, bool is_last);
  void add_warnings(publish::ServiceStatus& status) const;
  void log_new(const std::vector<std::string>& warnings, const pipeline::TrackedCameraFigures& camera);
  void show_metrics() const;
  void notify_manager(const pipeline::PipelineFigures& figures, const Healths& cameras, Clock::time_point now);

  const Supervised the_;
  const std::string tracked_camera_;  // its name; empty: none
  const std::size_t quorum_;
  StatusReporter reporter_;
  publish::ServiceStatus status_;
  std::vector<object_tracking::TrackState> logged_states_;
  std::set<std::string> logged_warnings_;
  pipeline::NoPoseLog no_pose_log_;
  Clock::time_point next_status_{}, next_watchdog_{};
  const std::optional<std::chrono::microseconds> watchdog_;
  bool is_ready_ = false;
};

// ---- Pure functions

// Whether all capture threads and the tracking thread were active within `patience`.
bool is_progressing(std::span<const capture::CameraHealth> cameras, const pipeline::PipelineFigures& figures,
                    std::chrono::steady_clock::time_point now, capture::Duration patience);

// For `systemctl status`: "2 of 3 cameras deliver: left 30.0, right 29.9 Hz, back absent; 29.9 sets/s, written 1.7 ms
// after their last byte (one in a hundred: 6.9); ball tracking".
// targets: as in status. latencies: of these sets, since the start. tracked_camera: its name, empty for none; then
// "cam0's pose lost" comes last.
std::string status_line(const publish::ServiceStatus& status, std::span<const metrics::TargetFigures> targets,
                        const metrics::LatencyHistogram::Snapshot& latencies = {},
                        const std::string& tracked_camera = {},
                        camera_tracking::PoseState camera_state = camera_tracking::PoseState::searching);

}  // namespace huetrack::daemon
