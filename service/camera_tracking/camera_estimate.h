// The result of a camera tracker for one frame: pose, covariance, state. A plain value.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <string_view>
#include <vector>

#include "calib/model/rigid3.h"
#include "capture/frames/frame.h"

namespace huetrack::camera_tracking {

enum class PoseState : std::uint8_t {
  searching,  // no pose yet
  tracking,   // the image supports the pose: pose and covariance are valid
  coasting,   // this frame does not support it (covered, blurred): predicted, with growing covariance
  lost,       // coasted too long or too far: no pose, relocalisation is tried
};
std::string_view name(PoseState state);  // "searching", ...

// Row and column order: x y z in metres, then rotation about the world's x y z in radians. That is ROS's order.
using Covariance6d = Eigen::Matrix<double, 6, 6>;

struct CameraEstimate {
  static constexpr double nan = std::numeric_limits<double>::quiet_NaN();

  capture::Timestamp at;           // capture time of the frame, to which the pose refers
  std::uint64_t frame_number = 0;  // counts the tracker's frames, from 0
  PoseState state = PoseState::searching;
  // p_world = world_from_camera * p_cam. NaN in searching and lost; never a stale pose.
  calib::Rigid3d world_from_camera{Eigen::Quaterniond(nan, nan, nan, nan), Eigen::Vector3d::Constant(nan)};
  // Of the errors (dt, w): true pose = (exp(w) R, t + dt), R and t from world_from_camera. NaN without a pose.
  Covariance6d covariance = Covariance6d::Constant(nan);
  int features_in_view = 0;  // map points (LEDs) that project into the image
  int features_matched = 0;  // of those, found where the pose projects them
  int map_points = 0;        // in the map, given ones included
  double confidence = 0;     // features_matched / features_in_view; 0 without a pose
  int particle_count = 0;
  double effective_sample_size = 0;  // 1..particle_count
  // Estimated readout time of the rolling shutter (first row's mid-exposure to the last one's) and its standard
  // deviation. NaN: the method does not estimate it.
  double readout_s = nan, readout_sigma_s = nan;

  bool has_pose() const { return state == PoseState::tracking || state == PoseState::coasting; }
};

// A point of the scene that the tracker uses: mapped, or given (a start point, a LED).
struct CameraMapPoint {
  enum class State : std::uint8_t {
    not_sought,  // in the last frame: out of view, or no pose
    missed,      // not found where the pose projects it
    found,
  };
  std::uint32_t id = 0;                                  // constant for the tracker's lifetime
  Eigen::Vector3d position = Eigen::Vector3d::Zero();    // world, metres
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // m^2
  State state = State::not_sought;
  bool given = false;
};
struct CameraMap {
  capture::Timestamp at;               // capture time of the last frame
  std::vector<CameraMapPoint> points;  // ascending ids
};

}  // namespace huetrack::camera_tracking
