// All reports of a session, in the same order live and in replay.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/session.h"
#include "reports/camera_times.h"
#include "reports/light_report.h"
#include "reports/mistake_report.h"
#include "reports/object_report.h"
#include "reports/rig_report.h"

namespace huetrack::reports {

struct ReportsOptions {
  std::filesystem::path write_rig = {};  // CameraTimes: rig with estimated timing; empty: no file
  bool is_logging_times = false;         // CameraTimes
  bool is_recorded = false;              // LightReport, MistakeReport
};

// The constructor adds all reports to the session. Outlives the session's run.
struct Reports {
  Reports(pipeline::Session& session, const ReportsOptions& options);  // throws as CameraTimes

  std::vector<std::string> warnings() const;  // of all reports, in force now. thread-safe

  LightReport light;
  MistakeReport mistakes;
  ObjectReport objects;
  RigReport rig;
  CameraTimes times;
};

}  // namespace huetrack::reports
