// A camera's view of a dark rectangle of 0.2 x 0.15 m on a light ground, drawn through the lens.
#pragma once

#include <cmath>
#include <vector>

#include "calib/model/camera_rig.h"
#include "camera_tracking/grey_image.h"

namespace huetrack::camera_tracking {

inline calib::Camera camera() {
  calib::PinholeRadtan lens{246, 246, 158, 122, {}};
  lens.distortion[0] = -0.12, lens.distortion[1] = 0.02;
  return {"cam", {320, 240}, calib::CameraModel(lens), {}, {}};
}

inline calib::Rigid3d look_at(const Eigen::Vector3d& from, const Eigen::Vector3d& at) {  // cam_from_world, upright
  const Eigen::Vector3d z = (at - from).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized(),
                        y = z.cross(x);
  Eigen::Matrix3d r;
  r.row(0) = x, r.row(1) = y, r.row(2) = z;
  return {Eigen::Quaterniond(r), -(r * from)};
}

inline std::vector<Eigen::Vector3d> rectangle_corners() {
  return {{-0.1, 0.075, 0}, {0.1, 0.075, 0}, {0.1, -0.075, 0}, {-0.1, -0.075, 0}};
}

// 6 x 6 samples per pixel, averaged as light, then coded as sRGB does.
inline GreyImage view_of_rectangle(const calib::Camera& c, const calib::Rigid3d& cam_from_world) {
  const calib::Rigid3d back = calib::inverse(cam_from_world);
  std::uint8_t* px = nullptr;
  GreyImage image = make_grey(320, 240, px);
  for (int v = 0; v < 240; ++v) {
    for (int u = 0; u < 320; ++u) {
      double light = 0;
      for (int k = 0; k < 36; ++k) {
        const auto ray = c.model.ray({Eigen::Vector2d(u + (k % 6 - 2.5) / 6, v + (k / 6 - 2.5) / 6)});
        const Eigen::Vector3d d = back.rotation * *ray;
        const Eigen::Vector3d p = back.translation - back.translation.z() / d.z() * d;
        light += (std::abs(p.x()) < 0.1 && std::abs(p.y()) < 0.075 ? 0.02 : 0.6) / 36;
      }
      px[v * 320 + u] = static_cast<std::uint8_t>(std::lround(255 * (1.055 * std::pow(light, 1 / 2.4) - 0.055)));
    }
  }
  return image;
}

}  // namespace huetrack::camera_tracking
