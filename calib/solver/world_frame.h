// Choice of the world frame: origin, axes and scale.
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
                    const calib::Rigid3d& new_from_old);  // the covariance is in the cameras' axes

// Default world: z up (image rows as level as possible), origin in the middle of the board's positions, x away from the
// first camera.
calib::Rigid3d upright_guess(const Adjustment& adjustment);

// World of a former rig for recalibrated cameras, by those with unchanged relative poses. nullopt: fewer than two
// cameras are in both.
struct KeptWorld {
  calib::Rigid3d new_from_old;  // for in_world(); new: the former world
  std::vector<std::string> by;  // unchanged cameras (to some centimetres and degrees), at least two
  std::vector<std::string> moved;
};
std::optional<KeptWorld> world_of(const calib::CameraRig& before, const Adjustment& adjusted);

// World of a board on the floor, front up: origin at its point 0, x along its rows, z up. height: of the board's
// surface above the floor, metres.
calib::Rigid3d floor_from_board(const calib::Rigid3d& world_from_board, double height);

// Least squares from points known in both worlds (Umeyama 1991). >= 3, not collinear; otherwise throws
// CalibrationError.
WorldChange align_points(const std::vector<Eigen::Vector3d>& old_points, const std::vector<Eigen::Vector3d>& new_points,
                         bool with_scale);

// From three or more points on the floor: z up (where the cameras are), origin at the first, x towards the second.
// throws CalibrationError: collinear_points, undecided_floor
calib::Rigid3d floor_from_points(const std::vector<Eigen::Vector3d>& old_points, const calib::CameraRig& rig);

// Triangulates pixels (camera index, raw pixel) by least reprojection error. throws CalibrationError: fewer than two
// cameras, or rays that do not meet in front of them.
struct MeasuredPoint {
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
  double rms_px = 0;
};
MeasuredPoint measure_point(const calib::CameraRig& rig, const std::vector<std::pair<int, Eigen::Vector2d>>& pixels);

}  // namespace huetrack::solver
