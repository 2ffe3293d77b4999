// Where the adjustment starts. Private to this module.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/wave/ball_path.h"

namespace huetrack::wave {

// Where each camera saw the ball, as far as it was decided: per camera, ascending in time.
struct BallTracks {
  struct Point {
    double t_s = 0;
    Eigen::Vector2d px;
  };
  std::vector<std::vector<Point>> of_camera;
  double max_gap_s = 0.1;  // between two points, that is bridged

  // The camera's points as if they had been seen so much earlier.
  void move_earlier(std::size_t camera, double by_s);
  // At the time itself, or between its two neighbours in a straight line; nullopt: not seen then.
  std::optional<Eigen::Vector2d> at(std::size_t camera, double t_s) const;
  // The times of camera a's points at which b saw the ball too.
  std::vector<double> shared(std::size_t a, std::size_t b) const;
};

// Where the rays of those of the given cameras that saw the ball meet at that time; nullopt: fewer than two did, or
// they do not meet.
std::optional<Eigen::Vector3d> crossing(const calib::CameraRig& rig, const std::vector<calib::Rigid3d>& cam_from_world,
                                        const std::vector<bool>& use, const BallTracks& tracks, double t_s);

// The ball's path where rays cross, and straight on between; how many of its control points are from rays is put into
// `crossed`.
BallPath triangulated_path(const calib::CameraRig& rig, const std::vector<calib::Rigid3d>& cam_from_world,
                           const BallTracks& tracks, double from_s, double to_s, double step_s, std::size_t* crossed);

// Where the adjustment starts.
struct WaveStart {
  std::vector<calib::Rigid3d> cam_from_world;
  std::vector<double> later_s = {};  // by which the cameras' stamps are later than was thought; empty: as was thought
};

// Camera poses from what they saw alone, in the frame of one of the cameras and with a scale of its own: the pair with
// most in common by its essential matrix (Nister 2004, in OpenCV), the others one by one from the path that those
// before make (PnP). Where they agree little, how late the stamps of one are is looked for, too.
// throws CalibrationError: no pair, or a camera, can be placed.
WaveStart start_from_nothing(const calib::CameraRig& rig, BallTracks tracks);

}  // namespace huetrack::wave
