// What a ball's outline is in a view, and how a frame's pixels lie for the fit to it (outline/outline_fit.h).
#pragma once

#include <Eigen/Core>
#include <optional>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "outline/outline_fit.h"

namespace huetrack::object_tracking {

// The bytes stay the image's.
outline::Picture picture_of(const capture::Image& image);
// Of a picture of that size, of which only a part is there.
outline::Picture picture_of(const capture::Matches::Patch& patch, int width, int height);

// A ball's outline is where the cone that touches it meets the image: an ellipse, as far as the lens is the same all
// over it. Its centre is not where the ball's centre is seen, but further out.
struct BallOutline {
  outline::Ellipse ellipse;
  Eigen::Vector2d centre_px;  // of the ball, projected
};
// nullopt: not all of it is where the lens is known.
std::optional<BallOutline> outline_of(const calib::Camera& camera, const Eigen::Vector3d& p_world, double radius_m);

}  // namespace huetrack::object_tracking
