// The pose of a frame's middle row from points that are seen in rows of other times, together with the motion between
// the rows.
#pragma once

#include <optional>
#include <span>

#include "calib/model/camera_model.h"
#include "camera_tracking/keyframes/camera_motion.h"
#include "camera_tracking/pose_solver.h"
#include "camera_tracking/swept_pose.h"

namespace huetrack::keyframes {

struct SweptFit {
  camera_tracking::SweptPose pose;
  // As refine_pose()'s. `information` is what is known of the middle row's pose when the motion is not, but for the
  // prior.
  camera_tracking::PoseFit fit;
  std::optional<Readout> readout;  // what this frame alone says; nullopt: nothing
};

// Gauss-Newton with Tukey's loss over the pose and the motion, which the prior holds. Each observation counts at the
// time of the row where it is seen. At least 3 observations.
SweptFit refine_swept_pose(const calib::CameraModel& lens,
                           std::span<const camera_tracking::PoseObservation> observations,
                           const camera_tracking::SweptPose& start, const MotionPrior& prior, int iterations = 10);

}  // namespace huetrack::keyframes
