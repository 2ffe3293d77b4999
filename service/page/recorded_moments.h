// Some moments of a recording, spread over all of it, for a colour that is taught from another one of them: so it is
// known what moves, how large the object is, and in which light it comes.
#pragma once

#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "capture/frames/frame.h"
#include "config/service_config.h"

namespace huetrack::page {

// No more than a ColorTeacher takes. It reads the whole recording, as fast as that decodes; what was found so far when
// it is asked to stop. words: as of recordings::read_recording(). throws std::runtime_error, as a replay does.
std::vector<capture::FrameSet> recorded_moments(const config::ServiceConfig& config, std::span<const std::string> words,
                                                const std::stop_token& stop);

}  // namespace huetrack::page
