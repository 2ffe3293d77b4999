// The first pose of an image-feature tracker, from the start that the user configured.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "camera_tracking/camera_tracker.h"
#include "camera_tracking/grey_image.h"
#include "camera_tracking/pose_solver.h"

namespace huetrack::camera_tracking {

struct StartResult {
  PoseFit pose;
  std::vector<Eigen::Vector3d> points;  // known points, world
  std::vector<Eigen::Vector2d> px;      // their raw pixels in the frame
  double sigma_px = 0.1;                // of px
  double given_sigma_m = 1e-4;          // of points; larger where the residuals of 6 or more points demand it
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // of their plane, towards the camera; zero: not coplanar
  bool rectangle = false;
  bool dark = false;  // the rectangle's inside
};

// thread-compatible.
class CameraStarter {
 public:
  CameraStarter(const calib::Camera& camera, const CameraStart& start) : camera_(camera), start_(start) {}

  // nullopt: not found in this frame; why_not() gives the reason. Pixels in the configuration refer to the first frame.
  // A rectangle or board that was detected without pixels is accepted at once if the position's sigma is below 0.5 % of
  // the distance, otherwise in the third consecutive frame with consistent poses.
  std::optional<StartResult> find(const capture::Image& image, const GreyImage& grey);
  std::string why_not() const { return why_not_; }  // of the last find(), for the user; empty: found
  // Detects the rectangle or board again, for a lost tracker. The caller has to verify the pose.
  //   near   last known cam_from_world: resolves the rectangle's symmetry under half a turn
  std::optional<calib::Rigid3d> find_again(const capture::Image& image, const GreyImage& grey,
                                           const calib::Rigid3d& near) const;

 private:
  std::optional<StartResult> accepted(std::optional<StartResult> started, std::size_t given, const std::string& what);
  std::optional<StartResult> confirmed(std::optional<StartResult> started);

  calib::Camera camera_;
  CameraStart start_;
  int frames_ = 0;
  std::optional<calib::Rigid3d> last_found_;  // cam_from_world, in the frame before
  int found_in_a_row_ = 0;                    // consecutive frames with consistent poses
  std::string why_not_;
};

}  // namespace huetrack::camera_tracking
