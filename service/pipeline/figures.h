// Counters and times of the pipeline: snapshots for status, metrics and summaries.
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

// Time spent in a stage so far, without waiting (for a paced frame, for room in a queue).
struct StageTime {
  capture::Duration wall{0};
  capture::Duration cpu{0};  // of our threads, without threads inside libraries (decoders)
};

struct CameraFigures {
  std::uint64_t frames = 0;          // with an image
  std::uint64_t dropped = 0;         // sequence gaps
  std::uint64_t corrupted = 0;       // received, but damaged
  std::uint64_t repeated = 0;        // part of `frames`: repeat the previous picture, not used
  std::uint64_t times_repeated = 0;  // runs of repeated frames
  bool has_changed = true;           // false: all its pictures so far were identical
  std::optional<std::uint32_t> last_sequence;
  std::optional<std::chrono::steady_clock::time_point> last_received;  // with an image
  std::optional<capture::Timestamp> last_captured;                     // the source's clock
  std::optional<capture::Timestamp> repeated_since;                    // first of the current run of repeated frames
  bool ended = false;                                                  // its source delivers no more frames
};

struct PipelineFigures {
  std::vector<CameraFigures> cameras;  // in the order of the rig
  capture::FrameSynchronizerCounters frame_sets;
  std::uint64_t sets_tracked = 0;
  std::uint64_t sets_dropped = 0;                              // by the queue: tracking was too slow
  StageTime decode, synchronise, watch, track, publish, draw;  // watch: of calibration and mistakes
  std::vector<objects::SearchFindings> searches;               // per target, updated about once a second
  std::vector<objects::SearchFindings> searches_of_run;        // the same of all sets since the start
  std::uint64_t camera_frames_tracked = 0;
  std::uint64_t camera_frames_dropped = 0;  // by the queue: camera tracking was too slow
  StageTime camera_track;
  TrackedCameraFigures tracked_camera;
  StageTime track_first;                                   // part of track: the first set, which builds colour tables
  std::chrono::steady_clock::time_point tracking_round{};  // last pass of the tracking thread's loop: once a second
};

}  // namespace huetrack::pipeline
