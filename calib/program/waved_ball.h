// The waved ball in a recording or in live images, for `wave` and `time`.
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
  std::string recording, config, rig, report;  // report: may be empty
  std::vector<std::string> targets;
  double live_s = 0;  // > 0: live, duration; 0: the recording
  std::optional<double> temperature_c;
  bool quiet = false, overwrite = false;
};

void add_waved_options(CLI::App& command, WavedOptions& options);

// The cameras to calibrate, and the ball.
struct WavedInput {
  calib::CameraRig rig;
  bool has_rig = true;  // false: of the cameras names and sizes are known, and the lenses are guesses
  std::vector<object_tracking::TargetOptions> targets;  // of one radius
  std::optional<config::ServiceConfig> config;
};

// From the configuration, with or without a rig. throws gather::InputError, and as load_service_config()
WavedInput configured_input(const WavedOptions& options);

// The cameras of these names with guessed lenses and the sizes that they have in the recording. throws as ReplaySource
calib::CameraRig guessed_rig(const std::string& recording, const std::vector<std::string>& names);

std::string names_of(const std::vector<object_tracking::TargetOptions>& targets);

// Candidates for the ball in every frame; several balls as if waved one after the other. Prints notes and progress.
// throws gather::InputError, and the exceptions of recordings and cameras
std::vector<wave::BallFrame> waved_frames(const WavedOptions& options, const WavedInput& in,
                                          const std::stop_token& stop);

// Calibrates, prints the report and writes the rig. note: fills in made_by. throws solver::CalibrationError, and as
// waved_frames()
ExitStatus calibrate_and_write(const WavedOptions& o, const WavedInput& in, wave::WaveOptions options,
                               const std::stop_token& stop,
                               const std::function<void(wave::WaveResult&, const report::WaveReport&)>& note);

}  // namespace huetrack::program
