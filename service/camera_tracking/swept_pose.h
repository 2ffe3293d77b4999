// The camera's pose during the readout of a rolling shutter: every row has its own pose.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <optional>

#include "calib/model/camera_model.h"
#include "calib/model/rigid3.h"

namespace huetrack::camera_tracking {

// The motion during the readout of a frame. The pose of a row is
//   exp(s motion + s^2 / 2 bend) * cam_from_world,  s = fraction(row) = row / last_row - 1/2
struct Sweep {
  calib::Tangent6d motion = calib::Tangent6d::Zero();  // readout time * velocity
  calib::Tangent6d bend = calib::Tangent6d::Zero();    // readout time^2 * acceleration
  double last_row = 1;                                 // index; 0 is the topmost one

  double fraction(double row) const { return std::clamp(row / last_row - 0.5, -0.75, 0.75); }  // clamped to +-0.75
  calib::Rigid3d row_from_middle(double row) const;
  // d (pixel of a patch if all of its rows were exposed at the given row's time) / d (pixel as exposed row by row).
  //   p_cam, d_px_d_cam  the patch's centre in the frame of its row, and the lens' Jacobian there
  Eigen::Matrix2d unskew(const calib::CameraModel::Jacobian& d_px_d_cam, const Eigen::Vector3d& p_cam,
                         double row) const;
  bool is_zero() const { return motion.isZero(0) && bend.isZero(0); }  // global shutter, or at rest
};

struct SweptPose {
  calib::Rigid3d cam_from_world;  // of the middle row, which is the frame's time
  Sweep sweep = {};

  calib::Rigid3d at(double row) const { return sweep.row_from_middle(row) * cam_from_world; }
};

// The pixel at which a world point is seen, consistent with the pose of that pixel's row. nullopt: as
// CameraModel::project().
struct SweptPixel {
  Eigen::Vector2d px;             // raw
  calib::Rigid3d cam_from_world;  // of its row
};
std::optional<SweptPixel> project_swept(const calib::CameraModel& lens, const SweptPose& pose,
                                        const Eigen::Vector3d& p_world);

}  // namespace huetrack::camera_tracking
