// Lee's start: a dark rectangle of known size on a light ground, or the reverse, found in a view and measured along its
// edges.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>

#include "calib/model/camera_model.h"
#include "camera_tracking/grey_image.h"
#include "camera_tracking/pose_solver.h"

namespace huetrack::camera_tracking {

struct RectangleCorners {
  std::array<Eigen::Vector2d, 4> px;  // raw, in the order of the corners; NaN: not measured
  std::array<bool, 4> measured{};
  int count() const { return measured[0] + measured[1] + measured[2] + measured[3]; }
};

// Where the corners lie to a tenth of a pixel or so: a line is fitted to each edge by its steepest brightness at many
// places, lens distortion removed, and neighbouring lines are intersected.
//   about      raw pixels, where the corners should be, in order around it; they may lie outside of the image
//   search_px  how far off an edge may be
//   dark       whether the inside is the dark side
// A corner whose two edges are not both seen well, over half their length and close to it, is not measured.
RectangleCorners measure_rectangle(const GreyImage& image, const calib::CameraModel& lens,
                                   const std::array<Eigen::Vector2d, 4>& about, double search_px, bool dark);

struct FoundRectangle {
  RectangleCorners corners;
  PoseFit pose;
  bool dark = true;
};
// corners_world: in order around it, clockwise as the camera sees them. Which way round is told by the rectangle's
// proportions, except that turned by half a turn it is the same: then it is the way that turns the camera least from
// `near`, and without that the first corner is the one further to the top left (smaller u + v). nullopt: there is none
// of 1 % of the image or more whose view fits the proportions; of several, the one with the strongest and cleanest
// contrast.
//   near   cam_from_world of some frames ago; may be null
std::optional<FoundRectangle> find_rectangle(const GreyImage& image, const calib::CameraModel& lens,
                                             std::span<const Eigen::Vector3d> corners_world,
                                             const calib::Rigid3d* near = nullptr);
// The rectangle whose corners are where the user says they are, within some pixels, and in that order.
std::optional<FoundRectangle> rectangle_at(const GreyImage& image, const calib::CameraModel& lens,
                                           std::span<const Eigen::Vector3d> corners_world,
                                           const std::array<Eigen::Vector2d, 4>& about);

}  // namespace huetrack::camera_tracking
