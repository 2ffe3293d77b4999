// What a session knows of a recording's cameras before their frames come.
#pragma once

#include "pipeline/session.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::pipeline {

// The sources of a session that tracks a recording, without the one that delivers its frames: whoever calls adds that.
SessionSources recorded_cameras(const recordings::Recording& recording, const recordings::ReplaySource& source);

}  // namespace huetrack::pipeline
