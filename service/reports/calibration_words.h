// Sentences about cameras that no longer stand where the rig says. Pure.
#pragma once

#include <string>

#include "config/service_config.h"
#include "pipeline/calibration_watch.h"

namespace huetrack::reports {

// "12:03:07" of a live time, "7.10 s" of a recording's own clock.
std::string moment_text(capture::Timestamp at);

// "cam1 was turned by 1.20 degrees and moved by 8 mm at 12:03:07: positions are wrong by about 40 mm until it is
// corrected"; empty if the camera is all right or its state is unknown.
std::string calibration_warning(const std::string& camera, const pipeline::CameraCalibration& facts,
                                config::CalibrationMode mode);

}  // namespace huetrack::reports
