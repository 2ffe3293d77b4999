// Predicted accuracy of triangulated points, from the covariance of a calibration.
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
  int views = 0;  // with fewer than two, the figures are 0
  // Standard deviation of the position (length of the three axes'), metres.
  double by_calibration_m = 0;  // after the best rigid alignment of the volume
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
  // Derivative of the best alignment (rotation vector about the box's middle, translation; world; 6 rows) by the
  // parameters of the calibration's covariance.
  Eigen::MatrixXd alignment;

  const PointAccuracy& at(int ix, int iy, int iz) const {
    return points[static_cast<std::size_t>((iz * steps[1] + iy) * steps[0] + ix)];
  }
};

// calibrated: with its covariance; in the world of `box`. steps: >= 2 each.
VolumeAccuracy predict_accuracy(const Adjustment& calibrated, const WorldBox& box, const std::array<int, 3>& steps,
                                double object_noise_px = 0.5);

// rms displacement of points of the volume after the best alignment: by a given error of the parameters, and as
// predicted by a covariance.
struct ShapeError {
  double seen_m = 0, expected_m = 0;
};
ShapeError shape_error(const Adjustment& calibrated, const WorldBox& box, const Eigen::VectorXd& error,
                       const Eigen::MatrixXd& covariance);

// The same for a rig file with its uncertainty, if any. `alignment` is empty: its world is aligned already.
VolumeAccuracy predict_accuracy(const calib::CameraRig& rig, const WorldBox& box, const std::array<int, 3>& steps,
                                double object_noise_px = 0.5);

// Pose of an additional camera that looks at the middle of the volume, and the accuracy with it.
struct CameraPlace {
  calib::Rigid3d cam_from_world;
  double covered = 0, median_total_m = 0, p95_total_m = 0;
};
// Candidates at the mean distance and the heights of the rig's cameras, with the first camera's lens and an exact pose.
// Best first, well apart. map: of this rig.
std::vector<CameraPlace> next_camera_places(const calib::CameraRig& rig, const VolumeAccuracy& map, std::size_t count);

// Standard deviations of a camera's pose in the world that is aligned with the volume: position (along the world's
// axes, metres) and rotation (about them, radians).
struct PoseSigma {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
};
PoseSigma pose_sigma(const Adjustment& calibrated, const VolumeAccuracy& volume, int camera);

// Uncertainty for the rig file, in the world aligned with the volume (see calib::RigUncertainty). nullopt: no
// covariance, or nothing is uncertain. Single camera: its lens only.
std::optional<calib::RigUncertainty> uncertainty_of(const Adjustment& calibrated, const VolumeAccuracy& volume);

// Box of the used corners in the world, from the 1 % to the 99 % quantile on each axis.
WorldBox board_volume(const Adjustment& calibrated);

}  // namespace huetrack::solver
