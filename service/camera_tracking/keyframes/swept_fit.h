// The pose of a rolling-shutter frame's middle row, estimated together with the motion during the readout.
#pragma once

#include <optional>
#include <span>

#include "calib/model/camera_model.h"
#include "camera_tracking/keyframes/camera_motion.h"
#include "camera_tracking/pose_solver.h"
#include "camera_tracking/swept_pose.h"

namespace huetrack::keyframes {

struct SweptFit {
  SweptPose pose;
  PoseFit fit;                     // as refine_pose(); `information` of the pose, with the motion marginalised
  std::optional<Readout> readout;  // measured by this frame alone, without the prior; nullopt: no information
};

// Gauss-Newton with Tukey's loss over pose and motion, with the prior of the motion. Each observation refers to the
// pose of its row. At least 3 observations.
SweptFit refine_swept_pose(const calib::CameraModel& lens, std::span<const PoseObservation> observations,
                           const SweptPose& start, const MotionPrior& prior, int iterations = 10);

}  // namespace huetrack::keyframes
