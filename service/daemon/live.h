// The service on live cameras: `run` and `record`.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <vector>

#include "config/service_config.h"
#include "daemon/supervisor.h"
#include "page/calibration_session.h"
#include "pipeline/live_cameras.h"

namespace huetrack::daemon {

struct LiveCommand {
  bool track = true;                     // false: only record
  std::filesystem::path record_to;       // record everything into this folder; empty: by the configuration
  bool no_dds = false;                   // overrides the configuration
  std::filesystem::path tracks;          // CSV of the estimates; empty: none
  std::filesystem::path write_rig = {};  // rig with estimated timing and current poses; empty: none
  std::filesystem::path poses = {};      // TUM file of the tracked camera's poses, see PoseFileWriter; empty: none
  std::optional<double> seconds;         // > 0; end this long after the first frame
};

struct LiveSummary {
  pipeline::PipelineFigures figures;
  publish::ServiceStatus status;  // the last one
  pipeline::RecorderFigures recorded;
  std::uint64_t published = 0;
};

// Runs until the stop, the end of every source, or requests.restart (which stays set; clients cannot request it if
// files are written or a duration is given). calibration: used by the page's thread, outlives the run; nullptr: none.
// throws what the pipeline throws, and std::exceptions with one readable line if an output cannot be opened.
LiveSummary run_live(const config::ServiceConfig& config, std::vector<pipeline::LiveCamera> cameras,
                     const LiveCommand& options, LiveRequests& requests, const std::stop_token& stop,
                     page::CalibrationSession* calibration = nullptr);

// Repeats run_live() on each request to restart, with the configuration read and the cameras opened again; between two
// runs replays a recording if requested. If the new configuration is invalid, logs that and keeps the old one.
using CameraOpener =
    std::function<std::vector<pipeline::LiveCamera>(const config::ServiceConfig& config, const std::stop_token& stop)>;
LiveSummary run_live_while_asked(config::ServiceConfig config, const CameraOpener& open, const LiveCommand& options,
                                 LiveRequests& requests, const std::stop_token& stop);

// `huetrackd run CONFIG` and `huetrackd record CONFIG OUT`. Log a summary; record() also prints it. throw as
// run_live(), and if nothing was recorded.
void run(const std::filesystem::path& config, const LiveCommand& options, LiveRequests& requests,
         const std::stop_token& stop);
void record(const std::filesystem::path& config, LiveCommand options, LiveRequests& requests,
            const std::stop_token& stop);

}  // namespace huetrack::daemon
