// A small bundle adjustment: some poses and points at once, by Levenberg-Marquardt with the points eliminated.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/model/camera_model.h"
#include "calib/model/rigid3.h"
#include "camera_tracking/swept_pose.h"

namespace huetrack::keyframes {

struct BundlePose {
  calib::Rigid3d cam_from_world;  // of the middle row
  bool fixed = false;
  camera_tracking::Sweep sweep = {};  // held
};
struct BundlePoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double prior_sigma_m = 0;  // > 0: it is known to be at `prior`, about so well
  Eigen::Vector3d prior = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // out, with the poses held
};
struct BundleObservation {
  int pose = 0;
  int point = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  // raw
  double sigma_px = 1;
  bool outlier = false;  // out: more than 3.5 robust sigmas off, or it has no pixel
};
struct BundleProblem {
  std::vector<BundlePose> poses;
  std::vector<BundlePoint> points;              // each seen by 2 poses or with a prior
  std::vector<BundleObservation> observations;  // sorted by point
};
struct BundleResult {
  bool converged = false;
  double rms = 0;  // of residual / sigma per axis, over the inliers
};
BundleResult adjust(const calib::CameraModel& lens, BundleProblem& problem, int iterations);

}  // namespace huetrack::keyframes
