// Robust estimate of a camera's rotation and zoom from where it sees known directions of the room. Pure; no exception.
// Rotation vectors: radians, camera frame, now_from_then.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "calib/model/camera_model.h"

namespace huetrack::room_watch {

struct SeenRay {
  Eigen::Vector3d ray;  // unit, of the camera as it was
  Eigen::Vector2d px;   // raw pixel where it is seen now
  double sigma_px;      // > 0; along each axis
};

struct RotationFit {
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double zoom = 0, zoom_sigma = 0;                      // share by which the picture grew about its principal point
  Eigen::Vector3d with_zoom = Eigen::Vector3d::Zero();  // covariance of rotation and zoom
  int inliers = 0;                                      // rays
  double rms_px = 0;                                    // of the inliers
  // The rotation that a shift of the camera is mistaken for: rotation vector = shift_to_rotation * (p_now - R p_then) /
  // distance of the room.
  Eigen::Matrix3d shift_to_rotation = Eigen::Matrix3d::Zero();
};

// Orientation and zoom of a camera relative to what they were.
struct Aim {
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
  double zoom = 0;
};
// Where it sees a ray of the camera as it was; nullopt: nowhere.
std::optional<Eigen::Vector2d> pixel_of(const calib::CameraModel& lens, const Aim& aim, const Eigen::Vector3d& ray);

// Iteratively reweighted least squares with Tukey's weights, from `start`. Rays farther than gate_px from their
// prediction have no weight at first. nullopt: fewer than 4 inliers, or they do not determine it.
std::optional<RotationFit> fit_rotation(const calib::CameraModel& lens, std::span<const SeenRay> seen, const Aim& start,
                                        double gate_px);

// The fit conditioned on zoom 0.
RotationFit without_zoom(const RotationFit& fit);
// The zoom that explains the fit without any rotation since `rotation`; nullopt: none does (chi-square, 99.9 %).
std::optional<double> zoom_instead(const RotationFit& fit, const Eigen::Vector3d& rotation);

// Consensus over all pairs of rays, without a start: a rotation, and a zoom only if clearly more rays agree with both.
// nullopt: no pair is confirmed by a third ray.
std::optional<Aim> guess_aim(const calib::CameraModel& lens, std::span<const SeenRay> seen, double gate_px);

Eigen::Vector3d turned(const Eigen::Vector3d& rotation, const Eigen::Vector3d& p);
Eigen::Vector3d turned_back(const Eigen::Vector3d& rotation, const Eigen::Vector3d& p);
// after_from_before.
Eigen::Vector3d rotation_between(const Eigen::Vector3d& before, const Eigen::Vector3d& after);

}  // namespace huetrack::room_watch
