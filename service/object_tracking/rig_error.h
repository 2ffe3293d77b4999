// The covariance that the calibration's uncertainty adds to a published position.
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

// A constant error, unobservable and never averaged away: not in the filter, but added to its output
// (calib/model/rig_uncertainty.h). Views that have lost the object count with a weight that decays. thread-compatible.
class RigError {
 public:
  // Copies the rig. position_sigma_m: > 0, upper bound of a published position's sigma; bounds the depth of a single
  // view.
  RigError(const calib::CameraRig& rig, double position_sigma_m);

  void add(std::span<const Sighting> sightings);
  // ObjectTracker::trust(): poses that replace the rig's state their own covariance, so theirs in the rig is dropped.
  void exclude_poses(std::span<const CameraTrust> cameras);

  // Of a position published for this time, m^2; zero for a rig without uncertainty.
  Eigen::Matrix3d left_open(const Eigen::Vector3d& position, capture::Timestamp at) const;

 private:
  struct LastView {
    bool any = false;
    capture::Timestamp at{};
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();  // 1/px^2
    double log_size_information = 0;                        // with one camera
  };
  calib::CameraRig rig_;                           // with the uncertainty in use
  std::optional<calib::RigUncertainty> as_found_;  // that of the rig's file
  Eigen::Matrix3d elsewhere_;
  std::vector<LastView> last_views_;  // per camera
};

}  // namespace huetrack::object_tracking
