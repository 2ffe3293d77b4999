// What is told people of cameras that no longer stand where the rig says. Pure.
#pragma once

#include <string>

#include "config/service_config.h"
#include "pipeline/calibration_watch.h"

namespace huetrack::reports {

// "12:03:07" of a live time, "7.10 s" of a recording's own clock.
std::string moment_text(capture::Timestamp at);

// "cam1 was turned by 1.20 degrees and moved by 8 mm at 12:03:07: positions are off by about 40 mm until it is mended";
// empty when all is well, or nothing can be said.
std::string calibration_warning(const std::string& camera, const pipeline::CameraCalibration& facts,
                                config::CalibrationMode mode);

}  // namespace huetrack::reports
