// Bundle adjustment of some poses and points: Levenberg-Marquardt with the points eliminated (Schur complement),
// Huber's loss. Each observation refers to the pose of its row.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/model/camera_model.h"
#include "calib/model/rigid3.h"
#include "camera_tracking/swept_pose.h"

namespace huetrack::keyframes {

using namespace camera_tracking;

struct BundlePose {
  calib::Rigid3d cam_from_world;  // of the middle row
  bool fixed = false;
  Sweep sweep = {};  // constant
};
struct BundlePoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double prior_sigma_m = 0;  // > 0: of a prior at `prior`, per axis
  Eigen::Vector3d prior = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // out, given the poses
};
struct BundleObservation {
  int pose = 0;
  int point = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  // raw
  double sigma_px = 1;
  bool outlier = false;  // out: residual above 3.5 robust sigmas, or no pixel
};
struct BundleProblem {
  std::vector<BundlePose> poses;
  std::vector<BundlePoint> points;              // each seen by 2 poses, or with a prior
  std::vector<BundleObservation> observations;  // sorted by point
};
struct BundleResult {
  bool converged = false;
  double rms = 0;  // of residual / sigma per axis, over the inliers
};
BundleResult adjust(const calib::CameraModel& lens, BundleProblem& problem, int iterations);

}  // namespace huetrack::keyframes
