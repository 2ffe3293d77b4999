// Which world the cameras stand in: its origin, axes and scale.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/solver/bundle_adjustment.h"

namespace huetrack::solver {

// p_new = scale * new_from_old.rotation * p_old + new_from_old.translation
struct WorldChange {
  calib::Rigid3d new_from_old;
  double scale = 1;

  Eigen::Vector3d operator*(const Eigen::Vector3d& p_old) const {
    return scale * (new_from_old.rotation * p_old) + new_from_old.translation;
  }
};

calib::CameraRig in_world(calib::CameraRig rig, const WorldChange& change);
Adjustment in_world(Adjustment adjustment,
                    const calib::Rigid3d& new_from_old);  // the covariance stays: it is the cameras' own

// A world to begin with, while nobody has said where the floor is: z up as the cameras are held (their image rows
// level, as far as they agree), the origin in the middle of where the board was, x away from the first camera.
calib::Rigid3d upright_guess(const Adjustment& adjustment);

// The world of a rig that was there before, for cameras that are calibrated anew: by those that stand to one another as
// they did. nullopt: fewer than two cameras are in both.
struct KeptWorld {
  calib::Rigid3d new_from_old;  // for in_world(): new: the world that was there before
  std::vector<std::string> by;  // the cameras that stand as they did, to some centimetres and degrees; at least two
  std::vector<std::string> moved;
};
std::optional<KeptWorld> world_of(const calib::CameraRig& before, const Adjustment& adjusted);

// The world in which a board lies on the floor, its front up: the origin is its point 0, x along its rows, z up.
// height: of the board's surface above the floor, metres.
calib::Rigid3d floor_from_board(const calib::Rigid3d& world_from_board, double height);

// From points whose place is known in both worlds, by least squares (Umeyama 1991). At least three, not in a line.
// throws CalibrationError
WorldChange align_points(const std::vector<Eigen::Vector3d>& old_points, const std::vector<Eigen::Vector3d>& new_points,
                         bool with_scale);

// From three or more points on the floor: z up (the side on which the cameras are), the origin at the first, x towards
// the second. throws CalibrationError
calib::Rigid3d floor_from_points(const std::vector<Eigen::Vector3d>& old_points, const calib::CameraRig& rig);

// Where the rays through these pixels (camera index, raw pixel) meet: the point of least reprojection error, and its
// rms. throws CalibrationError: fewer than two cameras, or rays that do not meet before them.
struct MeasuredPoint {
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
  double rms_px = 0;
};
MeasuredPoint measure_point(const calib::CameraRig& rig, const std::vector<std::pair<int, Eigen::Vector2d>>& pixels);

}  // namespace huetrack::solver
