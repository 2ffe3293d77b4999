// A camera's pose while a rolling shutter passes over its image: every row is exposed from where the camera is then.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "calib/model/camera_model.h"
#include "calib/model/rigid3.h"

namespace huetrack::camera_tracking {

// How a camera moves while a frame is read out. From the middle row on, and before it with a minus sign, the pose is
//   exp(part motion + part^2 / 2 bend) * cam_from_world,  part = row / last_row - 1/2
struct Sweep {
  calib::Tangent6d motion = calib::Tangent6d::Zero();  // from the first row's moment to the last one's
  calib::Tangent6d bend = calib::Tangent6d::Zero();    // by how much the second half's motion differs, times 2
  double last_row = 1;                                 // index; 0 is the topmost one

  double part(double row) const;  // rows far outside of the image count as its border's
  calib::Rigid3d row_from_middle(double row) const;
  // What a patch around a point would be if all of its rows were exposed when the point's is, by where they are seen,
  // d px / d px. p_cam is in the frame of the point's row, d_px_d_cam the lens' there.
  Eigen::Matrix2d unskewed(const calib::CameraModel::Jacobian& d_px_d_cam, const Eigen::Vector3d& p_cam,
                           double row) const;
  bool is_none() const { return motion.isZero(0) && bend.isZero(0); }  // a global shutter, or at rest
};

struct SweptPose {
  calib::Rigid3d cam_from_world;  // while the middle row is exposed: the frame's time
  Sweep sweep = {};

  calib::Rigid3d at(double row) const { return sweep.row_from_middle(row) * cam_from_world; }
};

// Where a point of the world is seen: in the row that is exposed while it is there. nullopt: as CameraModel::project().
struct SweptPixel {
  Eigen::Vector2d px;             // raw
  calib::Rigid3d cam_from_world;  // of its row
};
std::optional<SweptPixel> project_swept(const calib::CameraModel& lens, const SweptPose& pose,
                                        const Eigen::Vector3d& p_world);

}  // namespace huetrack::camera_tracking
