// What a camera tracker says about its camera after one frame. A plain value.
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
  searching,  // never found yet: there is no pose
  tracking,   // the view supports the pose: pose and covariance hold
  coasting,   // not supported by this frame (covered, shaken): predicted, with growing covariance
  lost,       // coasted too long or too far: there is no pose, relocalisation is tried
};
std::string_view name(PoseState state);  // "searching", ...

// Row and column order: x y z in metres, then rotation about the world's x y z in radians. That is ROS's order.
using Covariance6d = Eigen::Matrix<double, 6, 6>;

struct CameraEstimate {
  static constexpr double nan = std::numeric_limits<double>::quiet_NaN();

  capture::Timestamp at;           // capture time of the frame, to which the pose refers
  std::uint64_t frame_number = 0;  // counts the frames that were given to the tracker, from 0
  PoseState state = PoseState::searching;
  // p_world = world_from_camera * p_cam. NaN in searching and lost: there is none, and a stale one is never given.
  calib::Rigid3d world_from_camera{Eigen::Quaterniond(nan, nan, nan, nan), Eigen::Vector3d::Constant(nan)};
  // Of errors (dt, w) with true pose = (exp(w) R, t + dt), R and t from world_from_camera; NaN where there is no pose.
  Covariance6d covariance = Covariance6d::Constant(nan);
  int features_in_view = 0;  // map points (LEDs) that project into the image
  int features_matched = 0;  // and were found there, where the pose says
  int map_points = 0;        // in the map, given ones included
  double confidence = 0;     // 0..1: share of features_in_view that is matched, 0 without a pose
  int particle_count = 0;
  double effective_sample_size = 0;  // 1..particle_count
  // Of the camera's rolling shutter, as known by then: from the first row's mid-exposure to the last one's. NaN: the
  // method does not ask.
  double readout_s = nan, readout_sigma_s = nan;

  bool has_pose() const { return state == PoseState::tracking || state == PoseState::coasting; }
};

// A point of the scene that the tracker goes by: mapped, or given (a start's point, a LED).
struct CameraMapPoint {
  enum class State : std::uint8_t {
    not_sought,  // in the last frame: out of view, or there is no pose
    missed,      // sought, and not found where the pose says
    found,
  };
  std::uint32_t id = 0;                                  // stays the same as long as the tracker lives
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
