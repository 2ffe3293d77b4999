// The first pose of an image-feature tracker, from what the user said about the view.
#pragma once

#include <optional>
#include <vector>

#include "camera_tracking/camera_tracker.h"
#include "camera_tracking/grey_image.h"
#include "camera_tracking/pose_solver.h"

namespace huetrack {

struct Started {
  PoseFit pose;
  std::vector<Eigen::Vector3d> points;  // known ones, world
  std::vector<Eigen::Vector2d> px;      // and where they are seen, raw
  double sigma_px = 0.1;                // of px
  // How well the points are known: what their residuals in the view say, if they say that it is badly.
  double given_sigma_m = 1e-4;
  Eigen::Vector3d normal =
      Eigen::Vector3d::Zero();  // of their plane, towards the camera; zero: they are not in a plane
  bool rectangle = false;
  bool dark = false;  // the rectangle's inside
};

// thread-compatible.
class CameraStarter {
 public:
  CameraStarter(const Camera& camera, const CameraStart& start) : camera_(camera), start_(start) {}
  // nullopt: not found in this frame. A start that gives pixels is tried in the first frame only: it refers to that.
  std::optional<Started> find(const Image& image, const GreyImage& grey);

 private:
  Camera camera_;
  CameraStart start_;
  int frames_ = 0;
};

}  // namespace huetrack
