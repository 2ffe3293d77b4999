// What lenses of webcams and action cameras are like, as standard deviations: the prior of lenses that are estimated
// from boards, and of the focal lengths that wave estimates.
#pragma once

#include <cmath>
#include <numbers>
#include <string>

#include "calib/model/camera_rig.h"

namespace huetrack::calib {

// From some 25 published calibrations of webcams and small cameras with fields of view of 40 to 110 degrees
// (camera_info files of ROS users, Caliscope's webcams, Kinect 2, phones; calib/solver/EXPERIMENTS.md): root mean
// squares, and of decentring the largest. They contain those calibrations' own errors, and so are rather too wide.
struct UsualLensTuning {
  double fov_deg = 60;             // the middle: how wide a picture is
  double log_focal = 0.25;         // fields of view of 40 to 90 degrees
  double centre_share = 0.016;     // of the width: principal point from the middle, each axis
  double log_aspect = 0.003;       // fx over fy
  double radial_share = 0.2;       // of the radius at half the diagonal over the focal length, by each of k1, k2, k3
  double decentring_share = 5e-3;  // the same by p1, p2
};
inline constexpr UsualLensTuning usual_lens;

// A camera of which name, picture size and perhaps the field of view are known; no distortion, pose: identity.
inline Camera guessed_camera(const std::string& name, ImageSize size, double fov_deg = usual_lens.fov_deg) {
  const double focal = 0.5 * size.width / std::tan(0.5 * fov_deg * std::numbers::pi / 180);
  Camera camera;
  camera.name = name;
  camera.image_size = size;
  camera.model = CameraModel(PinholeRadtan{focal, focal, (size.width - 1) / 2.0, (size.height - 1) / 2.0, {}});
  return camera;
}

}  // namespace huetrack::calib
