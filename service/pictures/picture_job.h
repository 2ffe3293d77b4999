// What pictures are made of: the pipeline puts it together, the drawing surfaces and the previews read it.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "camera_tracking/camera_tracker.h"
#include "capture/frames/frame.h"
#include "capture/frames/frame_source.h"
#include "object_tracking/object_estimate.h"

namespace huetrack::pictures {

// A patch of a target's colour that never moves, and is left out (ObjectTracker::color_shares()).
struct StillPatch {
  std::size_t target = 0;
  int camera = 0;            // in the rig
  std::array<int, 4> box{};  // u_min v_min u_max v_max, raw pixels
};

// What a picture of one set needs. A plain value; images are shared, not copied.
struct PictureJob {
  capture::FrameSet set;
  std::vector<object_tracking::ObjectEstimate> estimates;  // in target order, one or more of each
  std::vector<std::vector<Eigen::Vector3f>> particles;     // per target
  std::vector<StillPatch> still = {};
};

// What a picture shows of one frame of a tracked camera.
struct CameraPictureJob {
  capture::Frame frame;
  camera_tracking::CameraEstimate estimate;
  camera_tracking::CameraTrackerInside inside;
  std::vector<camera_tracking::CameraMapPoint> start_map;  // in the frame of the start, where no feature is sought yet
};

}  // namespace huetrack::pictures
