// All that looks at every set and says in words what is not well: the same ones, in the same order, live and in replay.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/camera_times.h"
#include "pipeline/light_report.h"
#include "pipeline/mistake_report.h"
#include "pipeline/object_report.h"
#include "pipeline/rig_report.h"
#include "pipeline/session.h"

namespace huetrack::pipeline {

struct ReportsOptions {
  std::filesystem::path write_rig = {};  // CameraTimes: the rig as learnt; empty: no file
  bool is_logging_times = false;         // CameraTimes
};

// Each logs by itself what it finds. Outlives the session's run, into which it is put when it is made.
struct Reports {
  Reports(Session& session, const ReportsOptions& options);  // throws as CameraTimes

  std::vector<std::string> warnings() const;  // of all of them, in force now. thread-safe

  LightReport light;
  MistakeReport mistakes;
  ObjectReport objects;
  RigReport rig;
  CameraTimes times;
};

}  // namespace huetrack::pipeline
