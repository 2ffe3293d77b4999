// Describes a recording's cameras to a session before frames arrive.
#pragma once

#include "pipeline/session.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::pipeline {

// SessionSources of a recording, without the frame source itself, which the caller adds.
SessionSources recorded_cameras(const recordings::Recording& recording, const recordings::ReplaySource& source);

}  // namespace huetrack::pipeline
