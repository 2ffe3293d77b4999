// The service on live cameras, what `run` and `record` do.
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
  bool track = true;                     // false: only record, and do not publish
  std::filesystem::path record_to;       // record everything into this folder; empty: what the configuration says
  bool no_dds = false;                   // whatever the configuration says
  std::filesystem::path tracks;          // CSV of the estimates; empty: none
  std::filesystem::path write_rig = {};  // the rig as learnt: the cameras' times, and where they stand; empty: none
  std::filesystem::path poses = {};      // TUM file of the tracked camera's poses, see PoseFileWriter; empty: none
  std::optional<double> seconds;         // > 0; end so long after the first frame
};

struct LiveSummary {
  pipeline::PipelineFigures figures;
  publish::ServiceStatus status;  // the last one
  pipeline::RecorderFigures recorded;
  std::uint64_t published = 0;
};

// Runs until the stop, or until every source has ended, or requests.restart (which stays set; nobody can ask for it
// where a file is written that it would begin anew, or for a time that is given). calibration: asked from the page's
// thread, and outlives the run; nullptr: nothing can be calibrated.
// throws what the pipeline throws, and std::exceptions with one readable line when an output cannot be opened.
LiveSummary run_live(const config::ServiceConfig& config, std::vector<pipeline::LiveCamera> cameras,
                     const LiveCommand& options, LiveRequests& requests, const std::stop_token& stop,
                     page::CalibrationSession* calibration = nullptr);

// run_live(), and once more with the configuration as it stands then, with its cameras opened again, whenever that is
// asked for; between two of them a recording, where that is asked for, until it is over or closed. What is not right
// then is left alone, with a line in the log.
using CameraOpener =
    std::function<std::vector<pipeline::LiveCamera>(const config::ServiceConfig& config, const std::stop_token& stop)>;
LiveSummary run_live_while_asked(config::ServiceConfig config, const CameraOpener& open, const LiveCommand& options,
                                 LiveRequests& requests, const std::stop_token& stop);

// `huetrackd run CONFIG` and `huetrackd record CONFIG OUT`: with the cameras of the configuration. What came of it goes
// to the log, and of a recording to stdout, too. throw as run_live(), and when nothing has been recorded.
void run(const std::filesystem::path& config, const LiveCommand& options, LiveRequests& requests,
         const std::stop_token& stop);
void record(const std::filesystem::path& config, LiveCommand options, LiveRequests& requests,
            const std::stop_token& stop);

}  // namespace huetrack::daemon
