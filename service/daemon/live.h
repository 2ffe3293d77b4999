// The service on live cameras, what `run` and `record` do: it opens the cameras, runs the pipeline, watches over both,
// and talks to the bus, the log and the service manager.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "capture/frame_source.h"
#include "capture/v4l2_source.h"
#include "config/service_config.h"
#include "pipeline/pipeline.h"
#include "pipeline/recorder.h"
#include "publish/service_status.h"

namespace huetrack::daemon {

// What the service needs of a live camera: a V4l2Source, or what a test puts in its place.
struct LiveCamera {
  int camera = 0;  // in the rig
  std::unique_ptr<capture::FrameSource> source;
  std::function<capture::CameraHealth()> health;                   // thread-safe while source lives
  std::function<std::vector<capture::CameraEvent>()> take_events;  // likewise
};

// The cameras of the configuration, opened as far as they are there and answer, all at once; until a stop.
// throws CaptureError: one is there, but cannot do what is asked of it, or is there under two names.
std::vector<LiveCamera> open_cameras(const config::ServiceConfig& config, const std::stop_token& stop = {});

// "left and right are one camera: /dev/v4l/by-path/... and /dev/video0 are both /dev/video0"; nullopt: no two are.
std::optional<std::string> one_under_two_names(std::span<const config::LiveCameraConfig> cameras);

// What is asked of a running service from outside. thread-safe: signals set them, the service clears them.
struct LiveRequests {
  std::atomic<bool> reload = false;  // SIGHUP
  std::atomic<bool> save = false;    // SIGUSR1: the pre-roll
};

struct LiveOptions {
  bool track = true;                 // false: only record, and do not publish
  std::filesystem::path record_to;   // record everything into this folder; empty: what the configuration says
  bool no_dds = false;               // whatever the configuration says
  std::filesystem::path tracks;      // CSV of the estimates; empty: none
  std::filesystem::path poses = {};  // TUM file of the tracked camera's poses, see PoseFileWriter; empty: none
  std::optional<double> seconds;     // > 0; end so long after the first frame
};

struct LiveSummary {
  pipeline::PipelineFigures figures;
  publish::ServiceStatus status;  // the last one
  pipeline::RecorderFigures recorded;
  std::uint64_t published = 0;
};

// Runs until the stop, or until every source has ended.
// throws what the pipeline throws, and std::exceptions with one readable line when an output cannot be opened.
LiveSummary run_live(const config::ServiceConfig& config, std::vector<LiveCamera> cameras, const LiveOptions& options,
                     LiveRequests& requests, std::stop_token stop);

// ---- What it decides by, pure

// Whether frames, or deliberate waiting for them, go on everywhere: no thread has been away for longer than `patience`.
bool is_progressing(std::span<const capture::CameraHealth> cameras, const pipeline::PipelineFigures& figures,
                    std::chrono::steady_clock::time_point now, capture::Duration patience);

// For `systemctl status`: "2 of 3 cameras deliver: left 30.0, right 29.9 Hz, back absent; 29.9 sets/s; ball tracking".
// states: per target. tracked_camera: its name, empty for none; then "cam0's pose lost" comes last.
std::string status_line(const publish::ServiceStatus& status, std::span<const object_tracking::TrackState> states,
                        const std::string& tracked_camera = {},
                        camera_tracking::PoseState camera_state = camera_tracking::PoseState::searching);

}  // namespace huetrack::daemon
