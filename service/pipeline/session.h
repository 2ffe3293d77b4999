// One run of the program, live or on a recording: creates trackers, pipeline and outputs from the configuration by the
// same rules for both.
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

// A camera that delivers frames, and their known properties.
struct SessionCamera {
  struct Pixels {
    capture::PixelFormat format;
    capture::ColorRange range;
  };
  int camera = 0;                     // in the rig
  capture::Duration period{0};        // between two frames; 0: unknown
  std::optional<Pixels> pixels = {};  // nullopt: unknown
};

struct SessionSources {
  std::vector<std::unique_ptr<capture::FrameSource>> sources;
  // The delivering cameras as known by now: called at the start and by take_over().
  std::function<std::vector<SessionCamera>()> cameras;
  bool is_ascending = false;  // FrameSynchronizerOptions::ascending_input
};

struct SessionOptions {
  WhenFull when_full = WhenFull::wait;
  bool is_tracking = true;          // false: frames and sets only
  std::optional<int> threads = {};  // instead of the configuration's
  int pictures_every = 0;           // PipelineOptions::pictures_every
  RecordedChanges repeats = {};     // changes of the recorded run to repeat
};

// thread-compatible; run() once. Functions marked "any thread" may be called while it runs.
class Session {
 public:
  // Creates the trackers, with colour tables for the known pixel formats, and the default tolerance of sets from the
  // cameras' periods. throws std::invalid_argument: invalid tracker options; ConfigError: a recorded reload has other
  // targets; std::runtime_error: the map would replace another kind of file.
  Session(config::ServiceConfig config, SessionSources sources, SessionOptions options);

  // Before run(). Outputs are called in the order of add(), and outlive run().
  void add(Output& output);
  // Set it before run(). References stay valid.
  PublishedTime& time() { return time_; }
  // Before run(): frames are not released earlier than this.
  void hold_to(const Pace& pace) { pipeline_.hold_to(pace); }

  // As Pipeline::run(); then flushes the outputs in any case. throws the first error.
  void run(std::stop_token stop);
  // After run(): saves the tracked camera's map if configured. May be slow: end recordings before. throws
  // std::runtime_error, naming the file.
  void save_camera_map() const;
  void close_sources() { pipeline_.close_sources(); }

  // Result of a reloaded configuration.
  struct TakenOver {
    std::vector<std::string> searched_anew;  // targets that changed and have new trackers from the next set on
    std::vector<std::string> waiting;        // changed keys that need a restart
  };
  // Applies what may change while running: targets' colours and radii, object_tracking, ignored image regions, camera
  // controls (applied by the owner of the cameras), the log level, and control. Then calls the outputs' on_config(). By
  // one thread at a time, the only one that may use config(). throws std::runtime_error if the targets are not the
  // same; then nothing has changed.
  TakenOver take_over(const config::ServiceConfig& fresh);

  const config::ServiceConfig& config() const { return config_; }  // in force, with the chosen tolerance
  const calib::CameraRig& rig() const { return rig_; }             // any thread
  PipelineFigures figures() const { return pipeline_.figures(); }  // any thread
  const CalibrationWatch* calibration() const { return pipeline_.calibration(); }                      // after run()
  const camera_tracking::CameraTracker* camera_tracker() const { return pipeline_.camera_tracker(); }  // after run()

 private:
  object_trackers::ObjectTracker tracker_of(const config::ServiceConfig& config, std::size_t target) const;
  std::vector<object_trackers::ObjectTracker> trackers() const;
  PipelineOptions pipeline_options(const SessionOptions& options, bool is_ascending) const;
  Pipeline::Replacement replacement(const std::vector<std::size_t>& targets, const config::ServiceConfig& after) const;
  void repeat(const std::vector<RecordedReload>& reloads);
  void watch_calibration();

  const std::function<std::vector<SessionCamera>()> cameras_;
  const bool is_tracking_, tolerance_is_given_;
  const std::filesystem::path save_map_;  // empty: none
  config::ServiceConfig config_;
  std::vector<config::ServiceConfig> repeated_;  // recorded reloads, in order
  const calib::CameraRig rig_;                   // read by the pipeline while config_ may change
  PublishedTime time_;
  std::vector<Output*> outputs_;
  Pipeline pipeline_;
};

}  // namespace huetrack::pipeline
