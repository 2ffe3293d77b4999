// What the road counts and measures: snapshots for status, metrics and summaries.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <vector>

#include "capture/frames/frame.h"
#include "capture/timing/frame_synchronizer.h"
#include "object_tracking/trackers/object_tracker.h"
#include "pipeline/tracked_camera.h"

namespace huetrack::pipeline {

// What a stage took so far. Waiting (for a paced frame, for room in a queue) is not counted.
struct StageTime {
  capture::Duration wall{0};
  capture::Duration cpu{0};  // of our threads; threads inside libraries (decoders) are not seen
};

struct CameraFigures {
  std::uint64_t frames = 0;          // with an image
  std::uint64_t dropped = 0;         // sequence gaps
  std::uint64_t corrupted = 0;       // came, but damaged
  std::uint64_t repeated = 0;        // of frames: showed the picture before once more, and were not used
  std::uint64_t times_repeated = 0;  // so many pictures they showed
  bool has_changed = true;           // false: its pictures have all been one and the same so far
  std::optional<std::uint32_t> last_sequence;
  std::optional<std::chrono::steady_clock::time_point> last_received;  // with an image
  std::optional<capture::Timestamp> last_captured;                     // the source's clock
  std::optional<capture::Timestamp> repeated_since;                    // all since then are repeated ones
  bool ended = false;                                                  // its source has no more of it
};

// A snapshot of what has happened so far.
struct PipelineFigures {
  std::vector<CameraFigures> cameras;  // in the order of the rig
  capture::FrameSynchronizerCounters frame_sets;
  std::uint64_t sets_tracked = 0;
  std::uint64_t sets_dropped = 0;                              // by the queue, because tracking was too slow
  StageTime decode, synchronise, watch, track, publish, draw;  // watch: the calibration
  std::vector<objects::SearchFindings> searches;               // per target, about once a second and at the end
  std::uint64_t camera_frames_tracked = 0;
  std::uint64_t camera_frames_dropped = 0;  // by the queue, because camera tracking was too slow
  StageTime camera_track;
  TrackedCameraFigures tracked_camera;
  StageTime track_first;  // part of track: the first set, for which the trackers build colour tables
  std::chrono::steady_clock::time_point tracking_round{};  // when the tracking thread last came round: once a second
};

}  // namespace huetrack::pipeline
