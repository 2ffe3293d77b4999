// Report on whether a rig still fits its cameras' images: names a camera that moved, and by how much.
#pragma once

#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/report/calibration_report.h"
#include "calib/solver/rig_check.h"

namespace huetrack::report {

struct RigCheckReport {
  std::vector<Check> checks;  // the worst first
  Verdict verdict = Verdict::usable;
};

// rig: the checked one. board_doubt: contradiction between images and board file; may be empty.
RigCheckReport report_on(const solver::RigCheck& check, const calib::CameraRig& rig,
                         const std::string& board_doubt = {});

std::string to_text(const RigCheckReport& report, const solver::RigCheck& check);

}  // namespace huetrack::report
