// Detects a dark rectangle of known size on a light ground, or the reverse, and measures its corners along its edges
// (Lee's start).
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

// Corners to about 0.1 px: fits an undistorted line to the steepest points of each edge and intersects neighbours.
//   about      expected raw pixels of the corners, in order around it; they may lie outside the image
//   search_px  largest error of an expected edge
//   dark       the inside is the dark side
// A corner is measured only if both of its edges are visible over half their length and near the corner.
RectangleCorners measure_rectangle(const GreyImage& image, const calib::CameraModel& lens,
                                   const std::array<Eigen::Vector2d, 4>& about, double search_px, bool dark);

struct FoundRectangle {
  RectangleCorners corners;
  PoseFit pose;
  bool dark = true;
};
// The rectangle of at least 1 % of the image that fits the given proportions; of several, the one with the best
// contrast-to-noise ratio. The symmetry under half a turn is resolved by `near` (least rotation); without it the first
// corner is the one with the smaller u + v.
//   corners_world  in order around it, clockwise as the camera sees them
//   near           cam_from_world of a recent frame; may be null
std::optional<FoundRectangle> find_rectangle(const GreyImage& image, const calib::CameraModel& lens,
                                             std::span<const Eigen::Vector3d> corners_world,
                                             const calib::Rigid3d* near = nullptr);
// The rectangle whose corners lie at the given pixels, to within 12 px, in that order.
std::optional<FoundRectangle> rectangle_at(const GreyImage& image, const calib::CameraModel& lens,
                                           std::span<const Eigen::Vector3d> corners_world,
                                           const std::array<Eigen::Vector2d, 4>& about);

}  // namespace huetrack::camera_tracking
