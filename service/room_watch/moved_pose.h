// Where a camera stands that was turned or moved: by the room, which fixes its rotation, and by what it sees of an
// object whose position the other cameras fix, which tells a shift from a rotation.
//
// The room alone cannot: far walls move in the picture alike when the camera turns and when it is shifted. So the state
// is (b, v): p_now = Exp(b) Exp(room's rotation) p_then + v in the camera's axes, with v unknown to some centimetres,
// and the room says b = -shift_to_rotation v / distance, with the distance of the room known to a share of itself. An
// object at another depth than the room then tells both.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"

namespace huetrack::room_watch {

// A camera's sight of an object whose position others fix.
struct Witness {
  capture::Timestamp at;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();                   // raw pixels
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();           // px^2
  Eigen::Vector3d position = Eigen::Vector3d::Zero();             // world, metres
  Eigen::Matrix3d position_covariance = Eigen::Matrix3d::Zero();  // m^2
};

// What the room says of the camera's rotation since the rig was made (RoomCondition).
struct RoomRotation {
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d shift_to_rotation = Eigen::Matrix3d::Zero();
};

struct MovedPoseEstimate {
  calib::Rigid3d cam_from_world;
  Eigen::Matrix<double, 6, 6> covariance;  // of e: true = exp(e) * cam_from_world, e = (rotation, shift), camera axes
  Eigen::Vector3d rotation;                // by which it was turned: rotation vector, radians, camera axes
  Eigen::Vector3d shift;                   // of its centre, metres, camera axes
  double rotation_sigma = 0, shift_sigma = 0;  // of the least sure direction
};

// thread-compatible. A plain value; never throws.
class MovedPose {
 public:
  // room_distance_m: of what is seen of the room, as far as that is known. shift_sigma_m: how far it may have been
  // shifted.
  MovedPose(const calib::Camera& camera, double room_distance_m, double shift_sigma_m);

  void set_room(const RoomRotation& room);
  void add(const Witness& witness);
  const MovedPoseEstimate& estimate() const { return estimate_; }

 private:
  using Matrix9 = Eigen::Matrix<double, 9, 9>;
  using Vector9 = Eigen::Matrix<double, 9, 1>;
  void solve();

  calib::Camera camera_;
  double room_distance_m_, shift_sigma_m_;
  RoomRotation room_;
  Matrix9 information_ = Matrix9::Zero();  // of the witnesses, about (b, v, o)
  Vector9 weighted_ = Vector9::Zero();     // information times value
  Vector9 state_ = Vector9::Zero();
  Matrix9 covariance_ = Matrix9::Zero();
  std::optional<capture::Timestamp> last_at_;
  MovedPoseEstimate estimate_;
};

}  // namespace huetrack::room_watch
