// What the calibration's own uncertainty leaves open of a target's position, by the views that fixed it.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/model/rig_uncertainty.h"
#include "object_tracking/sighting.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::object_tracking {

// An error that lasts: no frame tells it, and none averages it away, so it is no part of what the filter believes, and
// is added to what it reports (calib/model/rig_uncertainty.h). A position hangs for a while on what views said that
// have lost the object since: they count, less and less. thread-compatible.
class RigError {
 public:
  // Copies the rig. position_sigma_m: > 0, how well a position is known at least while it is told; without it a single
  // view would leave its depth wholly open.
  RigError(const calib::CameraRig& rig, double position_sigma_m);

  // After every set.
  void add(std::span<const Sighting> sightings);
  // ObjectTracker::trust(): what is open of poses that are others than the rig's now is said in their own covariance.
  // Replaces what was said before.
  void exclude_poses(std::span<const CameraTrust> cameras);

  // Of the covariance of a position that is told for this moment, m^2; zero for a rig of which nothing is known.
  Eigen::Matrix3d left_open(const Eigen::Vector3d& position, capture::Timestamp at) const;

 private:
  struct LastView {
    bool any = false;
    capture::Timestamp at{};
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();  // 1/px^2
  };
  calib::CameraRig rig_;                           // with the uncertainty that counts
  std::optional<calib::RigUncertainty> as_found_;  // that of the rig's file
  Eigen::Matrix3d elsewhere_;
  std::vector<LastView> last_views_;  // per camera, when it last saw the object
};

}  // namespace huetrack::object_tracking
