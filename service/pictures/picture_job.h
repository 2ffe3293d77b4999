// What pictures are made of: the pipeline puts it together, the drawing surfaces and the previews read it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "camera_tracking/camera_tracker.h"
#include "capture/frame.h"
#include "capture/frame_source.h"
#include "object_tracking/object_estimate.h"

namespace huetrack {

// What a picture of one set needs. A plain value; images are shared, not copied.
struct PictureJob {
  FrameSet set;
  std::vector<ObjectEstimate> estimates;                // per target
  std::vector<std::vector<Eigen::Vector3f>> particles;  // per target
};

// The same of one frame of a tracked camera.
struct CameraPictureJob {
  Frame frame;
  CameraEstimate estimate;
  CameraTrackerView view;
  std::vector<CameraMapPoint> start_map;  // in the frame of the start, where no feature is sought yet
};

}  // namespace huetrack
