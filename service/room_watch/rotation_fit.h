// How a camera was turned, from where it sees known directions of the room. Robust: who walks through, and what was
// moved, is outvoted. Pure; no exception.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "calib/model/camera_model.h"

namespace huetrack::room_watch {

struct SeenRay {
  Eigen::Vector3d ray;    // unit, of the camera as it was
  Eigen::Vector2d px;     // raw pixel where it is seen now
  double sigma_px = 0.1;  // > 0; along each axis
};

struct RotationFit {
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  // now_from_then as a rotation vector, radians, camera frame
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double zoom = 0, zoom_sigma = 0;                      // share by which the picture grew about its principal point
  Eigen::Vector3d with_zoom = Eigen::Vector3d::Zero();  // covariance of rotation and zoom
  int held = 0;                                         // rays that agree with it
  double rms_px = 0;                                    // of those
  // By how much a shift of the camera passes for a rotation: rotation vector = shift_to_rotation * (p_now - R p_then) /
  // distance of the room.
  Eigen::Matrix3d shift_to_rotation = Eigen::Matrix3d::Zero();
};

// Where a camera looks now, and how large it shows things.
struct Aim {
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  // as of RotationFit
  double zoom = 0;
};
// Where it sees a ray of what it was; nullopt: nowhere.
std::optional<Eigen::Vector2d> pixel_of(const calib::CameraModel& lens, const Aim& aim, const Eigen::Vector3d& ray);

// From `start` on. Rays farther than gate_px from where it has them are not listened to at first.
// nullopt: fewer than 4 agree, or they do not fix it.
std::optional<RotationFit> fit_rotation(const calib::CameraModel& lens, std::span<const SeenRay> seen, const Aim& start,
                                        double gate_px);

// The same, of a camera whose zoom is as it was: the rotation alone, and how sure that is then.
RotationFit without_zoom(const RotationFit& fit);
// The zoom alone that explains it, of a camera that stands where it did at that rotation; nullopt: none does.
std::optional<double> zoom_instead(const RotationFit& fit, const Eigen::Vector3d& rotation);

// What most agree with, to gate_px, found without knowing where to start: a rotation, and a zoom only if clearly more
// agree with both. nullopt: no two rays that more agree with than they themselves.
std::optional<Aim> guess_aim(const calib::CameraModel& lens, std::span<const SeenRay> seen, double gate_px);

// Rotation vectors and what they do.
Eigen::Vector3d turned(const Eigen::Vector3d& rotation, const Eigen::Vector3d& p);
Eigen::Vector3d turned_back(const Eigen::Vector3d& rotation, const Eigen::Vector3d& p);
// after_from_before: the rotation that takes `before` to `after`.
Eigen::Vector3d rotation_between(const Eigen::Vector3d& before, const Eigen::Vector3d& after);

}  // namespace huetrack::room_watch
