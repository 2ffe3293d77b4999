// The waved ball in a recording, or before the live cameras: what `wave` and `time` look at.
#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/program/commands.h"
#include "calib/report/wave_report.h"
#include "calib/wave/wave.h"
#include "config/service_config.h"
#include "object_tracking/tracker_options.h"

namespace CLI {
class App;
}

namespace huetrack::program {

struct WavedOptions {
  std::string recording, config, rig, report;  // report: empty: none is written
  std::vector<std::string> targets;
  double live_s = 0;  // > 0: live, for so long; 0: the recording
  std::optional<double> temperature_c;
  bool quiet = false, overwrite = false;
};

void add_waved_options(CLI::App& command, WavedOptions& options);

// What is to be calibrated, with which ball.
struct WavedInput {
  calib::CameraRig rig;
  std::vector<object_tracking::TargetOptions> targets;  // of one radius
  std::optional<config::ServiceConfig> config;
};

// What the configuration says. throws gather::InputError, and what load_service_config() throws
WavedInput configured_input(const WavedOptions& options);

std::string names_of(const std::vector<object_tracking::TargetOptions>& targets);

// Where the ball may be in every frame, of several balls as if waved one after the other. Prints notes and progress.
// throws gather::InputError, and what a recording or a camera throws
std::vector<wave::BallFrame> waved_frames(const WavedOptions& options, const WavedInput& in,
                                          const std::stop_token& stop);

// Finds what options asks for, prints what it is worth and writes the rig. note: fills in how it was made.
// throws CalibrationError, and what waved_frames() throws
ExitStatus calibrate_and_write(const WavedOptions& o, const WavedInput& in, wave::WaveOptions options,
                               const std::stop_token& stop,
                               const std::function<void(wave::WaveResult&, const report::WaveReport&)>& note);

}  // namespace huetrack::program
