// Data of pictures: filled by the pipeline, drawn by pictures and previews.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "camera_tracking/camera_tracker.h"
#include "capture/frames/frame.h"
#include "capture/frames/frame_source.h"
#include "object_tracking/object_estimate.h"

namespace huetrack::pictures {

// Static clutter of a target's colour (ObjectTracker::color_shares()).
struct StillPatch {
  std::size_t target = 0;
  int camera = 0;            // in the rig
  std::array<int, 4> box{};  // u_min v_min u_max v_max, raw pixels
};

// Data of a picture of one set. Images are shared, not copied.
struct PictureJob {
  capture::FrameSet set;
  std::vector<object_tracking::ObjectEstimate> estimates;  // in target order, one or more of each
  std::vector<std::vector<Eigen::Vector3f>> particles;     // per target
  std::vector<StillPatch> still = {};
};

// Data of a picture of one frame of a tracked camera.
struct CameraPictureJob {
  capture::Frame frame;
  camera_tracking::CameraEstimate estimate;
  camera_tracking::CameraTrackerInside inside;
  std::vector<camera_tracking::CameraMapPoint> start_map;  // in the frame of the start
};

}  // namespace huetrack::pictures
