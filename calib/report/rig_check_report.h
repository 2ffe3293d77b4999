// Whether a rig still fits what its cameras see, for people: a camera that was bumped is named, with how far it moved.
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

// rig: the one that was checked.
RigCheckReport report_on(const solver::RigCheck& check, const calib::CameraRig& rig);

std::string to_text(const RigCheckReport& report, const solver::RigCheck& check);

}  // namespace huetrack::report
