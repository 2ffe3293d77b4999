// One run of the program, on live cameras or on a recording: the trackers, the road and its outputs, made from the
// configuration by the same rules for both.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame_source.h"
#include "capture/frames/pixel_format.h"
#include "config/service_config.h"
#include "pipeline/output.h"
#include "pipeline/pipeline.h"
#include "pipeline/published_time.h"
#include "pipeline/recorded_changes.h"

namespace huetrack::pipeline {

// A camera that delivers frames, and what is known of them before they come.
struct SessionCamera {
  struct Pixels {
    capture::PixelFormat format;
    capture::ColorRange range;
  };
  int camera = 0;                     // in the rig
  capture::Duration period{0};        // the usual time between two frames; 0: unknown
  std::optional<Pixels> pixels = {};  // nullopt: unknown
};

struct SessionSources {
  std::vector<std::unique_ptr<capture::FrameSource>> sources;
  // Those that deliver, and what is known by now: asked at the start, and again by take_over().
  std::function<std::vector<SessionCamera>()> cameras;
  bool is_ascending = false;  // FrameSynchronizerOptions::ascending_input
};

struct SessionOptions {
  WhenFull when_full = WhenFull::wait;
  bool is_tracking = true;          // false: frames and sets only, whatever the configuration says
  std::optional<int> threads = {};  // instead of the configuration's
  int pictures_every = 0;           // PipelineOptions::pictures_every
  RecordedChanges repeats = {};     // what happened when the recording was made happens again
};

// thread-compatible; run() once. What says so may be called by another thread while it runs.
class Session {
 public:
  // Makes the trackers, with their colour tables as far as the pixels are known, and decides what the configuration
  // leaves open: the tolerance of sets, by the periods of the cameras.
  // throws std::invalid_argument: trackers that cannot be made so; ConfigError: a recorded reload has other targets;
  // std::runtime_error: where the map is to be saved another kind of file lies.
  Session(config::ServiceConfig config, SessionSources sources, SessionOptions options);

  // Before run(). The output is called after those that were added before it, and outlives run().
  void add(Output& output);
  // Before run(): how published times are made. What outputs hold of time() stays valid.
  PublishedTime& time() { return time_; }
  // Before run(): frames come no sooner than this.
  void hold_to(const Pace& pace) { pipeline_.hold_to(pace); }

  // As Pipeline::run(); then the outputs are flushed, whatever has ended it. throws the first of what went wrong.
  void run(std::stop_token stop);
  // After run(). The tracked camera's map, where the configuration says so; it may lie on a slow disk, so whoever
  // records ends the recording before. throws std::runtime_error, naming the file.
  void save_camera_map() const;
  void close_sources() { pipeline_.close_sources(); }

  // What came of a configuration that was read again.
  struct TakenOver {
    std::vector<std::string> searched_anew;  // targets: they differ, and have new trackers from the next set on
    std::vector<std::string> waiting;        // keys that changed, too: that takes effect at the next start
  };
  // Puts into force what may change while running: the targets' colours and radii, how they are tracked, what of the
  // images is ignored, the cameras' controls (whoever has the cameras applies them), the log's level, and what may be
  // asked over the bus. Then tells the outputs. While it runs: one
  // thread at a time, which is also the only one that may use config().
  // throws std::runtime_error: the targets are not the same; then nothing has changed.
  TakenOver take_over(const config::ServiceConfig& fresh);

  const config::ServiceConfig& config() const { return config_; }  // in force, with the tolerance that was decided on
  const calib::CameraRig& rig() const { return rig_; }             // any thread
  PipelineFigures figures() const { return pipeline_.figures(); }  // any thread
  const CalibrationWatch* calibration() const { return pipeline_.calibration(); }  // not while it runs
  const camera_tracking::CameraTracker* camera_tracker() const {
    return pipeline_.camera_tracker();
  }  // not while it runs

 private:
  object_trackers::ObjectTracker tracker_of(const config::ServiceConfig& config, std::size_t target) const;
  std::vector<object_trackers::ObjectTracker> trackers() const;
  PipelineOptions pipeline_options(const SessionOptions& options, bool is_ascending) const;
  Pipeline::Replacement replacement(const std::vector<std::size_t>& targets, const config::ServiceConfig& after) const;
  // throws ConfigError: one has other targets
  void repeat(const std::vector<RecordedReload>& reloads);
  void watch_calibration();

  const std::function<std::vector<SessionCamera>()> cameras_;
  const bool is_tracking_, tolerance_is_given_;
  const std::filesystem::path save_map_;  // empty: no map is saved
  config::ServiceConfig config_;
  std::vector<config::ServiceConfig> repeated_;  // of recorded reloads: each of them is, or will be, in force
  const calib::CameraRig rig_;                   // the road reads it, while config_ may change
  PublishedTime time_;
  std::vector<Output*> outputs_;
  Pipeline pipeline_;
};

}  // namespace huetrack::pipeline
