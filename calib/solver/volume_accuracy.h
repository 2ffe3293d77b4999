// How well a calibrated rig will place a point: predicted from the covariance of the calibration, before anything is
// tracked.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "calib/solver/bundle_adjustment.h"

namespace huetrack::solver {

struct WorldBox {
  Eigen::Vector3d low = Eigen::Vector3d::Zero();  // metres, world
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
  bool operator==(const WorldBox&) const = default;
};

struct PointAccuracy {
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
  int views = 0;  // cameras that see it; with fewer than two there is no figure
  // Standard deviation of the position (length of the three axes'), metres.
  double by_calibration_m = 0;  // the shape of the space: what is left after the best rigid alignment of the volume
  double total_m = 0;           // with the noise of the object's centre in the images
};

struct VolumeAccuracy {
  WorldBox box;
  std::array<int, 3> steps{};         // points along x, y, z
  std::vector<PointAccuracy> points;  // x fastest, then y, then z
  double object_noise_px = 0;         // standard deviation of the object's centre per axis
  // Over the points that two or more cameras see:
  double covered = 0;  // their share
  double median_by_calibration_m = 0, p95_by_calibration_m = 0;
  double median_total_m = 0, p95_total_m = 0;
  // The rigid motion (rotation vector about the box's middle, then translation; world) of the best alignment, by the
  // parameters of the calibration's covariance: 6 rows. What is left when it is taken away is the error of shape.
  Eigen::MatrixXd alignment;

  const PointAccuracy& at(int ix, int iy, int iz) const {
    return points[static_cast<std::size_t>((iz * steps[1] + iy) * steps[0] + ix)];
  }
};

// calibrated: with its covariance; cameras' poses in the world that `box` is in. steps: >= 2 each.
VolumeAccuracy predict_accuracy(const Adjustment& calibrated, const WorldBox& box, const std::array<int, 3>& steps,
                                double object_noise_px = 0.5);

// rms over the places of the volume, after the best alignment: of what an error of the parameters moves them by, and of
// what a covariance of theirs says that it would be.
struct ShapeError {
  double seen_m = 0, expected_m = 0;
};
ShapeError shape_error(const Adjustment& calibrated, const WorldBox& box, const Eigen::VectorXd& error,
                       const Eigen::MatrixXd& covariance);

// The accuracy of a rig as its file has it, with its uncertainty if it has one; its world is aligned already, so that
// `alignment` stays empty.
VolumeAccuracy predict_accuracy(const calib::CameraRig& rig, const WorldBox& box, const std::array<int, 3>& steps,
                                double object_noise_px = 0.5);

// A place from which one camera more would help, looking at the middle of the volume.
struct CameraPlace {
  calib::Rigid3d cam_from_world;
  double covered = 0, median_total_m = 0, p95_total_m = 0;  // of the volume, then
};
// Around the volume, as far off and as high as the cameras of the rig are, with the lens of the first of them; its pose
// as if it were exactly known. The best first, none close to a better one. map: of this rig.
std::vector<CameraPlace> next_camera_places(const calib::CameraRig& rig, const VolumeAccuracy& map, std::size_t count);

// Standard deviations of a camera's pose in the world that is aligned with the volume: position (along the world's
// axes, metres) and rotation (about them, radians).
struct PoseSigma {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
};
PoseSigma pose_sigma(const Adjustment& calibrated, const VolumeAccuracy& volume, int camera);

// What was found of the cameras' uncertainty, in the world that is aligned with the volume (see calib::RigUncertainty
// for why), for the rig file. nullopt: there is no covariance, or nothing is uncertain. Of a single camera it is the
// lens.
std::optional<calib::RigUncertainty> uncertainty_of(const Adjustment& calibrated, const VolumeAccuracy& volume);

// Where the board was: the box of its used corners in the world, without the outermost hundredth on every side.
WorldBox board_volume(const Adjustment& calibrated);

}  // namespace huetrack::solver
