// Initial values for the adjustment. Private to this module.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/wave/ball_path.h"

namespace huetrack::wave {

// Image tracks of the ball: per camera, ascending in time.
struct BallTracks {
  struct Point {
    double t_s = 0;
    Eigen::Vector2d px;
  };
  std::vector<std::vector<Point>> of_camera;
  double max_gap_s = 0.1;  // longest gap that at() interpolates over

  void move_earlier(std::size_t camera, double by_s);
  // Linear interpolation between neighbours; nullopt: not seen then.
  std::optional<Eigen::Vector2d> at(std::size_t camera, double t_s) const;
  // Times of camera a's points at which b saw the ball too.
  std::vector<double> shared(std::size_t a, std::size_t b) const;
};

// Ball position at a time, from the rays of the cameras in `use`; nullopt: fewer than two saw it, or they do not meet.
std::optional<Eigen::Vector3d> triangulated(const calib::CameraRig& rig,
                                            const std::vector<calib::Rigid3d>& cam_from_world,
                                            const std::vector<bool>& use, const BallTracks& tracks, double t_s);

// Path through the triangulated positions, linear between them. count: how many control points were triangulated.
BallPath triangulated_path(const calib::CameraRig& rig, const std::vector<calib::Rigid3d>& cam_from_world,
                           const BallTracks& tracks, double from_s, double to_s, double step_s, std::size_t* count);

struct WaveStart {
  std::vector<calib::Rigid3d> cam_from_world;
  std::vector<double> later_s = {};  // correction of each camera's latency; empty: none
};

// Camera poses from image tracks alone, in the frame of one camera and with an arbitrary scale. The pair with most
// inliers comes from its essential matrix (Nister 2004, OpenCV); the others follow one by one from the path so far
// (PnP). Where few points agree, latencies of up to 60 ms are searched, too.
// throws CalibrationError: no pair agrees (contradicting_motion), or a camera cannot be placed (unplaced_camera).
WaveStart start_from_nothing(const calib::CameraRig& rig, BallTracks tracks);

}  // namespace huetrack::wave
