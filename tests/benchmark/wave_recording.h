// What `huetrack-calibrate wave` finds in the pictures of a recording whose rig is known.
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/wave/ball_finder.h"
#include "calib/wave/wave.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::figures {

struct WaveRecording {
  calib::CameraRig truth, start;  // the configured rig, rig_off.yaml
  object_tracking::TargetOptions target;
  solver::WorldBox volume;
  std::vector<wave::BallFrame> frames;  // with their outlines
  std::vector<double> stamp_s;          // per frame, as the driver gave it
  std::vector<std::size_t> number;      // per frame: which of its camera's
};

// folder: of ../shared/tools/scenes. throws std::exception: it cannot be read
WaveRecording wave_recording(const std::filesystem::path& folder);

}  // namespace huetrack::figures
