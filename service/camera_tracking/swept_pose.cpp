#include "camera_tracking/swept_pose.h"

#include <Eigen/Geometry>
#include <cmath>

namespace huetrack::camera_tracking {

calib::Rigid3d Sweep::row_from_middle(double row) const {
  const double s = fraction(row);
  return calib::exp(calib::Tangent6d(s * motion + 0.5 * s * s * bend));
}

Eigen::Matrix2d Sweep::unskew(const calib::CameraModel::Jacobian& d_px_d_cam, const Eigen::Vector3d& p_cam,
                              double row) const {
  const calib::Tangent6d per_row = (motion + fraction(row) * bend) / last_row;
  const Eigen::Vector3d moved = per_row.head<3>().cross(p_cam) + per_row.tail<3>();
  Eigen::Matrix2d out = Eigen::Matrix2d::Identity();
  out.col(1) -= d_px_d_cam * moved;
  return out;
}

std::optional<SweptPixel> project_swept(const calib::CameraModel& lens, const SweptPose& pose,
                                        const Eigen::Vector3d& p_world) {
  auto seen = lens.project(pose.cam_from_world * p_world);
  if (!seen) return std::nullopt;
  SweptPixel out{seen->px, pose.cam_from_world};
  if (pose.sweep.is_zero()) return out;
  // Fixed-point iteration on the row; it converges fast, since the image moves by far less than a row in a row's time.
  constexpr int most_steps = 5;
  constexpr double near_enough_px = 0.02;
  for (int i = 0; i < most_steps; ++i) {
    const double row = out.px.y();
    out.cam_from_world = pose.at(row);
    seen = lens.project(out.cam_from_world * p_world);
    if (!seen) return std::nullopt;
    out.px = seen->px;
    if (std::abs(out.px.y() - row) < near_enough_px) break;
  }
  return out;
}

}  // namespace huetrack::camera_tracking
