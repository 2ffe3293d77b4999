// Pose of a camera that was turned or shifted, from two sources: the room, which determines the rotation, and sightings
// of an object whose position the other cameras determine, which separate shift from rotation.
//
// The room alone cannot separate them: far walls move alike in the picture for both. State: (b, v) with
// p_now = Exp(b) Exp(room's rotation) p_then + v in the camera's axes, and a bias o common to the others' positions.
// Room: b = -shift_to_rotation v / distance, the distance uncertain by a share of itself. See design.md.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"

namespace huetrack::room_watch {

// One camera's sighting of an object, and the object's position by the other cameras.
struct ReferenceSighting {
  capture::Timestamp at;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();                   // raw pixels
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();           // px^2
  Eigen::Vector3d position = Eigen::Vector3d::Zero();             // world, metres
  Eigen::Matrix3d position_covariance = Eigen::Matrix3d::Zero();  // m^2
};

// The camera's rotation since the rig was made, by the room (RoomCondition).
struct RoomRotation {
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d shift_to_rotation = Eigen::Matrix3d::Zero();
};

struct MovedPoseEstimate {
  calib::Rigid3d cam_from_world;
  Eigen::Matrix<double, 6, 6> covariance;  // of e: true = exp(e) * cam_from_world, e = (rotation, shift), camera axes
  Eigen::Vector3d rotation;                // since the rig was made: rotation vector, radians, camera axes
  Eigen::Vector3d shift;                   // of its centre, metres, camera axes
  double rotation_sigma = 0, shift_sigma = 0;  // of the least certain direction
};

// thread-compatible. A plain value; never throws.
class MovedPose {
 public:
  // room_distance_m: mean distance of the visible room. shift_sigma_m: prior of the shift.
  MovedPose(const calib::Camera& camera, double room_distance_m, double shift_sigma_m);

  void set_room(const RoomRotation& room);
  void add(const ReferenceSighting& sighting);
  const MovedPoseEstimate& estimate() const { return estimate_; }

 private:
  using Matrix9 = Eigen::Matrix<double, 9, 9>;
  using Vector9 = Eigen::Matrix<double, 9, 1>;
  void solve();

  calib::Camera camera_;
  double room_distance_m_, shift_sigma_m_;
  RoomRotation room_;
  Matrix9 information_ = Matrix9::Zero();  // of the sightings, about (b, v, o)
  Vector9 weighted_ = Vector9::Zero();     // information times value
  Vector9 state_ = Vector9::Zero();
  Matrix9 covariance_ = Matrix9::Zero();
  std::optional<capture::Timestamp> last_at_;
  MovedPoseEstimate estimate_;
};

}  // namespace huetrack::room_watch
