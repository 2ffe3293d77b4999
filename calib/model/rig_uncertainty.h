// What a calibration leaves open of a rig's cameras, all of them together, and what that leaves open of a position.
//
// An error of the cameras lasts: it is the same in every frame, so that no filter averages it away, and positions near
// one another share most of it. Frame: a camera's pose errs as cam_from_world_true = exp(error) * cam_from_world, the
// error (rotation in radians, shift in metres) in the camera's own axes, so that it does not change when the world is
// moved.
//
// Gauge: a common motion of all cameras, which turns and shifts the whole world, is no error. Where the world lies is
// said by whoever puts its origin somewhere (`huetrack-calibrate world`), and distances do not notice it. What writes a
// RigUncertainty has taken away the rigid motion that a place in the volume of the calibration shares with all others,
// by least squares over that volume: what is left is the error of shape, a little smaller in the volume's middle than
// at its ends. The covariance has six directions without variance for that, so that nothing may invert it.
//
// Linear in the errors (good to some degrees and centimetres). Pure values, safe from any thread; nothing throws.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "calib/model/camera_model.h"

namespace huetrack::calib {

struct CameraRig;

using Covariance6d = Eigen::Matrix<double, 6, 6>;

struct RigUncertainty {
  // Which of the parameters are a camera's: first those of its lens (fx fy cx cy and its distortion, in the order of
  // CameraModel's lenses), then the six of its pose.
  struct OfCamera {
    int at = 0;  // the first of them
    int lens_count =
        0;  // 0: the lens is exactly known; otherwise 8, 9 or 12 (pinhole_radtan), 8 (fisheye_kb), 12 (the rest)
    bool has_pose = false;
    int size() const { return lens_count + (has_pose ? 6 : 0); }
    int pose_at() const { return at + lens_count; }
    bool operator==(const OfCamera&) const = default;
  };
  std::vector<OfCamera> cameras;  // beside the rig's, their parameters in its order without a gap
  // covariance = (sigma.asDiagonal() * root) (sigma.asDiagonal() * root)^T. A root, because a matrix that is rounded
  // in a file is no covariance any more, and this one always is.
  Eigen::VectorXd sigma;  // standard deviations: pixels, 1, radians, metres
  Eigen::MatrixXd root;   // lower triangular, rows of length 1: of the correlations

  // cameras: without `at`. covariance: symmetric, positive semidefinite. Rounded to what the rig file holds of it (six
  // digits of a sigma, six decimals of the root), so that it reads back to the same bits.
  static RigUncertainty of(std::vector<OfCamera> cameras, const Eigen::MatrixXd& covariance);

  int size() const { return static_cast<int>(sigma.size()); }
  Eigen::MatrixXd covariance() const;
  Eigen::MatrixXd factor() const { return sigma.asDiagonal() * root; }  // covariance = factor * factor^T
  std::vector<std::string> problems(const CameraRig& rig) const;        // empty when valid
};

// Uncertain lenses have this many parameters.
bool is_lens_count(const CameraModel& model, int count);

// The uncertainty with another one of this camera's pose, which nothing else has to do with any more: it was found
// anew, in the world of the other cameras. None is made where there was none: then it stands alone.
RigUncertainty with_pose_covariance(const CameraRig& rig, int camera, const Covariance6d& covariance);

// A view that sees a place, and how well.
struct PlaceView {
  int camera = 0;               // in the rig
  Eigen::Matrix2d information;  // inverse covariance of where it sees it, 1/px^2
};

// How a position that these views give moves, when the cameras are not quite where the rig says: metres per unit of
// every parameter. By least squares over the views, and over what else is known of the position (elsewhere: an inverse
// covariance, 1/m^2, that is held; for two views or more it may be 0). Views that do not see p_world do not count.
//   G = (E + sum J_i' W_i J_i)^-1 [.. J_i' W_i H_i ..],   J = d px / d p_world, H = d px / d parameters
// That is the consider term of Schmidt (1966): an error that the filter knows of and does not estimate.
Eigen::Matrix3Xd position_gain_of_cameras(const CameraRig& rig, const RigUncertainty& uncertainty,
                                          const Eigen::Vector3d& p_world, std::span<const PlaceView> views,
                                          const Eigen::Matrix3d& elsewhere = Eigen::Matrix3d::Zero());

// What the rig leaves open of that position: G covariance G^T, m^2. Zero for a rig without uncertainty.
Eigen::Matrix3d rig_covariance_at(const CameraRig& rig, const Eigen::Vector3d& p_world,
                                  std::span<const PlaceView> views,
                                  const Eigen::Matrix3d& elsewhere = Eigen::Matrix3d::Zero());

}  // namespace huetrack::calib
