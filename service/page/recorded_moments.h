// Frame sets spread over a recording, for teaching: they show what moves, the object's size, and its light.
#pragma once

#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "capture/frames/frame.h"
#include "config/service_config.h"

namespace huetrack::page {

// At most as many as a ColorTeacher takes. Decodes the whole recording; after a stop, returns what it has. words: as
// for recordings::read_recording(). throws std::runtime_error, as a replay.
std::vector<capture::FrameSet> recorded_moments(const config::ServiceConfig& config, std::span<const std::string> words,
                                                const std::stop_token& stop);

}  // namespace huetrack::page
