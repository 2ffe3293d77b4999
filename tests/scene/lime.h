// What many tests track: a lime ball that flies through the room of three cameras, and a rig that is wrong about one.
#pragma once

#include <cmath>

#include "object_tracking/tracker_options.h"
#include "scene/scene.h"

namespace huetrack::scene {

// The colour that balls of BallOptions have.
inline object_tracking::TargetOptions lime() {
  object_tracking::TargetOptions target;
  target.name = "lime";
  target.color.hue_min_deg = 65, target.color.hue_max_deg = 115;
  return target;
}

inline Scene lime_that_flies() {
  return SceneBuilder{}
      .cameras_on_ring({.count = 3})
      .ball({.path =
                 [](double t) {
                   return Eigen::Vector3d(0.6 * std::sin(2.1 * t), 0.6 * std::cos(1.7 * t),
                                          1 + 0.5 * std::sin(2.9 * t + 1));
                 }})
      .build();
}

// About an axis of its own.
inline void turn(calib::Camera& camera, double radians, const Eigen::Vector3d& axis) {
  calib::Tangent6d tangent = calib::Tangent6d::Zero();
  tangent.head<3>() = radians * axis.normalized();
  camera.cam_from_world = calib::exp(tangent) * camera.cam_from_world;
}

}  // namespace huetrack::scene
