// What `huetrack-calibrate wave` found, for people.
#pragma once

#include <string>

#include "calib/wave/wave.h"

namespace huetrack {

std::string to_text(const WaveResult& result);

}  // namespace huetrack
