// The service's metrics as Prometheus text (format 0.0.4), and the HTTP server for them.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "capture/frames/frame.h"
#include "object_tracking/object_estimate.h"
#include "publish/service_status.h"
#include "view_watch/view_watch.h"

namespace huetrack::metrics {

// Histogram of durations with fixed buckets from 0.05 ms to 1 s, dense in the usual range. thread-safe; add() is
// lock-free.
class LatencyHistogram {
 public:
  static constexpr std::array<double, 24> bounds_s{0.00005, 0.0001, 0.00015, 0.0002, 0.00025, 0.0003, 0.00035, 0.0004,
                                                   0.00045, 0.0005, 0.0006,  0.0008, 0.001,   0.0012, 0.0015,  0.002,
                                                   0.003,   0.005,  0.01,    0.02,   0.05,    0.1,    0.2,     1.0};
  void add(capture::Duration latency);
  struct Snapshot {
    std::array<std::uint64_t, bounds_s.size() + 1> counts{};  // per bucket, not cumulated; last: beyond the bounds
    double sum_s = 0;
    std::uint64_t count() const;
    // Below it lies this share (0 .. 1) of all, interpolated within a bucket; the last bound if it is beyond. NaN:
    // none.
    double quantile_s(double share) const;
  };
  Snapshot snapshot() const;

 private:
  std::array<std::atomic<std::uint64_t>, bounds_s.size() + 1> counts_{};
  std::atomic<std::int64_t> sum_ns_ = 0;
};

struct TargetFigures {
  object_tracking::TrackState state = object_tracking::TrackState::searching;
  double effective_sample_size = 0;
  int particles = 0;
  // Objects that are tracked now, that coast now, and all found so far (with count 1: how often it was found).
  int most = 1;  // `count`
  int tracked = 0, coasting = 0;
  std::uint64_t found = 0;
  std::array<bool, view_watch::mistake_kinds> mistakes{};  // by kind, current
};

struct LatencyFigures {
  std::vector<LatencyHistogram::Snapshot> capture_to_dequeue;  // per camera of the status
  LatencyHistogram::Snapshot dequeue_to_write;    // from a set's last frame to the DDS write of its last native sample
  LatencyHistogram::Snapshot dequeue_to_publish;  // the same to the end of that write
  LatencyHistogram::Snapshot capture_to_publish;  // from the newest capture time in a set to that end
};

struct RecordingCounts {
  bool is_recording = false;
  std::vector<std::uint64_t> dropped;  // frames, per camera of the status; empty: recording is not configured
};

// Pose change of a camera.
struct CalibrationFigures {
  bool is_in_place = true;
  double turned_deg = 0, moved_m = 0, effect_m = 0;  // of positions, if not corrected
  double blur_px = 0, changed_share = 0;             // by a focus change; share of the picture with a changed room
};

// targets: as status.targets, or empty. calibration: per camera of the status; empty: not watched.
std::string to_prometheus(const publish::ServiceStatus& status, std::span<const TargetFigures> targets,
                          const LatencyFigures& latencies, const RecordingCounts& recording, std::uint64_t published,
                          std::span<const CalibrationFigures> calibration = {});

// Serves GET /metrics with the latest text. thread-safe.
class MetricsServer {
 public:
  // throws std::runtime_error, naming the port, if it is not available.
  MetricsServer(const std::string& address, int port);
  ~MetricsServer();  // closes all connections
  void show(std::string text);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::metrics
