// The first pose of an image-feature tracker, from what the user said about the view.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "camera_tracking/camera_tracker.h"
#include "camera_tracking/grey_image.h"
#include "camera_tracking/pose_solver.h"

namespace huetrack::camera_tracking {

struct Started {
  PoseFit pose;
  std::vector<Eigen::Vector3d> points;  // known ones, world
  std::vector<Eigen::Vector2d> px;      // and where they are seen, raw
  double sigma_px = 0.1;                // of px
  // How well the points are known: what their residuals in the view say, if they say that it is badly.
  double given_sigma_m = 1e-4;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // of their plane, towards the camera; zero: they are in none
  bool rectangle = false;
  bool dark = false;  // the rectangle's inside
};

// thread-compatible.
class CameraStarter {
 public:
  CameraStarter(const calib::Camera& camera, const CameraStart& start) : camera_(camera), start_(start) {}

  // nullopt: not in this frame; why_not() says why. Pixels that the user gave are of the first frame. What nobody
  // pointed at, a rectangle or a board, counts at once where the view leaves less than 0.5 % of the distance open, else
  // in the third frame in a row, from places that one camera can have had.
  std::optional<Started> find(const capture::Image& image, const GreyImage& grey);
  std::string why_not() const { return why_not_; }  // of the last find(), for the user; empty: it was found
  // What was started from, seen again: a proposal for somebody who will prove it. Known points with pixels are never.
  //   near   cam_from_world when it was last known: a rectangle looks the same turned by half a turn
  std::optional<calib::Rigid3d> find_again(const capture::Image& image, const GreyImage& grey,
                                           const calib::Rigid3d& near) const;

 private:
  std::optional<Started> accepted(std::optional<Started> started, std::size_t given, const std::string& what);
  std::optional<Started> confirmed(std::optional<Started> started);

  calib::Camera camera_;
  CameraStart start_;
  int frames_ = 0;
  std::optional<calib::Rigid3d> last_found_;  // cam_from_world, in the frame before
  int found_in_a_row_ = 0;                    // frames, with poses that follow each other
  std::string why_not_;
};

}  // namespace huetrack::camera_tracking
