// The image of a ball's outline, and a frame's pixels as the outline fit reads them (outline/outline_fit.h).
#pragma once

#include <Eigen/Core>
#include <optional>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "object_tracking/target_views.h"
#include "outline/outline_fit.h"

namespace huetrack::object_tracking {

outline::Picture picture_of(const capture::Image& image);  // refers to the image
// Of a patch, the only part that is there of an image of this size.
outline::Picture picture_of(const capture::Matches::Patch& patch, int width, int height);

// The view's pixels around this place: the image, or of a frame of matches the patch in which it is most central.
std::optional<outline::Picture> picture_around(const TargetView& view, const Eigen::Vector2d& px);

// The tangent cone's image: an ellipse, as far as the lens is locally affine. Its centre lies further out than the
// ball's projected centre.
struct BallOutline {
  outline::Ellipse ellipse;
  Eigen::Vector2d centre_px;  // the ball's centre, projected
};
// nullopt: a part of it is outside the lens model.
std::optional<BallOutline> outline_of(const calib::Camera& camera, const Eigen::Vector3d& p_world, double radius_m);

}  // namespace huetrack::object_tracking
