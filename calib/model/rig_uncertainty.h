// Joint covariance of a rig's calibration errors, and the covariance of a position that follows from it.
//
// Calibration errors are constant over time: no filter averages them away, and nearby positions share most of them.
// Frame: cam_from_world_true = exp(error) * cam_from_world, with the error (rotation in radians, shift in metres) in
// the camera's axes, so that it does not change when the world frame is moved.
//
// Gauge: a common rigid motion of all cameras is no error (`huetrack-calibrate world` chooses the world frame, and
// distances do not depend on it). The writer of a RigUncertainty removes the common motion by least squares over the
// calibrated volume; what remains is the error of shape, a little smaller in the middle of the volume than at its ends.
// The covariance is therefore singular in six directions and must not be inverted.
//
// Linear in the errors (valid to some degrees and centimetres). Pure values; thread-safe; nothing throws.
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
  // The parameters of one camera: its lens (fx fy cx cy and distortion, in CameraModel's order), then its pose (6).
  struct CameraParameters {
    int at = 0;          // index of the first
    int lens_count = 0;  // 0: lens exact; 8, 9 or 12 (pinhole_radtan), 8 (fisheye_kb), 12 (stereographic)
    bool has_pose = false;
    int size() const { return lens_count + (has_pose ? 6 : 0); }
    int pose_at() const { return at + lens_count; }
    bool operator==(const CameraParameters&) const = default;
  };
  std::vector<CameraParameters> cameras;  // as in the rig, in its order, contiguous
  // covariance = (sigma.asDiagonal() * root) (sigma.asDiagonal() * root)^T. The root is stored
  // because a rounded covariance matrix may become indefinite.
  Eigen::VectorXd sigma;  // standard deviations: pixels, 1, radians, metres
  Eigen::MatrixXd root;   // lower triangular, rows of length 1; root of the correlation matrix

  // cameras: without `at`. covariance: symmetric, positive semidefinite. Rounded to the digits of the rig file (six of
  // a sigma, six decimals of the root), so that it reads back to the same bits.
  static RigUncertainty of(std::vector<CameraParameters> cameras, const Eigen::MatrixXd& covariance);

  int size() const { return static_cast<int>(sigma.size()); }
  Eigen::MatrixXd covariance() const;
  Eigen::MatrixXd factor() const { return sigma.asDiagonal() * root; }  // covariance = factor * factor^T
  std::vector<std::string> problems(const CameraRig& rig) const;        // empty when valid
};

// Whether an uncertain lens of this kind may have `count` parameters.
bool is_lens_count(const CameraModel& model, int count);

// The rig's uncertainty with this camera's pose covariance replaced and its correlations removed: the pose was
// estimated anew relative to the other cameras. A rig without uncertainty gets that of this pose alone.
RigUncertainty with_pose_covariance(const CameraRig& rig, int camera, const Covariance6d& covariance);

// An observation of a position by one camera.
struct PlaceView {
  int camera = 0;               // in the rig
  Eigen::Matrix2d information;  // inverse covariance of the pixel, 1/px^2
  // Inverse variance of the logarithm of the image of an object of known size; 0: not measured. Decentring and radial
  // terms of the lens are neglected in it: the size is taken to grow with the focal length and to fall with the
  // distance from the camera's centre.
  double log_size_information = 0;
};

// Sensitivity of a least-squares position from these views to the rig's parameters, metres per unit (3 x parameters):
//   G = (E + sum J_i' W_i J_i)^-1 [.. J_i' W_i H_i ..],   J = d z / d p_world, H = d z / d parameters, z: pixel, log
//   size
// with E = prior_information on the position (1/m^2; may be 0 for two views or more). Views that do not see p_world are
// ignored; zero if the position is undetermined. Consider term of the Schmidt-Kalman filter (Schmidt 1966).
Eigen::Matrix3Xd position_gain_of_cameras(const CameraRig& rig, const RigUncertainty& uncertainty,
                                          const Eigen::Vector3d& p_world, std::span<const PlaceView> views,
                                          const Eigen::Matrix3d& prior_information = Eigen::Matrix3d::Zero());

// Covariance of that position due to the rig: G covariance G^T, m^2. Zero for a rig without uncertainty.
Eigen::Matrix3d rig_covariance_at(const CameraRig& rig, const Eigen::Vector3d& p_world,
                                  std::span<const PlaceView> views,
                                  const Eigen::Matrix3d& prior_information = Eigen::Matrix3d::Zero());

}  // namespace huetrack::calib
