// What `huetrack-calibrate wave` found, for people.
#pragma once

#include <string>

#include "calib/wave/wave.h"

namespace huetrack::report {

std::string to_text(const wave::WaveResult& result);

}  // namespace huetrack::report
