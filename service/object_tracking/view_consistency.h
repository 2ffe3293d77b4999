// Tests whether an object's views are consistent, and inflates the covariance of those that are not: by their epipolar
// residuals (epipolar_consistency.h) and by the pose uncertainty of CameraTrust.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/epipolar_consistency.h"
#include "object_tracking/motion_state.h"
#include "object_tracking/seen_regions.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::object_tracking {

// thread-compatible.
class ViewConsistency {
 public:
  ViewConsistency(std::size_t cameras, double radius_m, const ObjectTrackerOptions& options);

  // ObjectTracker::trust(): cameras whose history is void, and the pose covariances.
  void trust(std::span<const std::size_t> changed, std::span<const CameraTrust> cameras);
  void forget();  // all history: it was seen with wrong timing

  // Compares every pair of views, before any is rejected; then inflates the sightings and `watched` (of cameras that
  // are not used). A view without a sighting is searched for a moving region elsewhere. Logs regions in `seen`.
  void compare(const std::vector<TargetView>& views, capture::Timestamp set_at, const MotionState& state,
               std::vector<Sighting>& sightings, std::vector<Sighting>& watched, SeenRegions& seen);
  // Without the search and the inflation: one of several objects, whose other regions may be other objects.
  void compare_sightings(const MotionState& state, std::span<const Sighting> sightings);
  // The sightings that an object was just found by.
  void compare_found(const MotionState& state, std::vector<Sighting>& sightings);
  // No object is tracked: compares the only moving region of each view, so that a wrong rig is detected before a false
  // object is found. regions[i] and expected_px[i], the object's approximate radius, belong to views[i].
  void compare_moving(const std::vector<TargetView>& views, std::span<const std::vector<color::ColorRegion>> regions,
                      std::span<const double> expected_px, capture::Timestamp set_at, const MotionState& state);

  // The room shares the colour in this camera: moving regions are no evidence.
  void set_shared(std::size_t camera, bool is_shared) { is_shared_[camera] = is_shared; }

  void inflate(const MotionState& state, std::vector<Sighting>& sightings) const;
  // Adds the same to the covariance of a predicted place in a view, px^2.
  void inflate_prediction(std::size_t camera, const calib::Camera& in_view, const Eigen::Vector3d& position,
                          const BallProjection& at, Eigen::Matrix2d& covariance) const;
  // Largest sigma of the position by these sightings with their inflation, m; 0: no view is inflated.
  double inflated_sigma(const MotionState& state, std::span<const Sighting> sightings) const;
  bool no_consistent_pair() const { return epipolar_.no_consistent_pair(); }
  double inflation_px2(std::size_t camera) const { return epipolar_.variance_px2(camera); }
  double noise_scale2() const { return epipolar_.noise_scale2(); }

 private:
  // A view that should show the object and does not, or that is searched.
  struct Unseen {
    std::vector<color::ColorRegion> older = {}, newer = {};  // of the whole image, earlier
    capture::Timestamp older_at{}, newer_at{};
    bool is_suspicious = false;  // something moved in it in the last search
  };
  std::optional<PathResidual> residual_of(const Sighting& sighting, const MotionState& state) const;
  const color::ColorRegion* only_moving(int camera, std::span<const color::ColorRegion> regions, double radius_px,
                                        capture::Timestamp at);
  std::optional<PathResidual> residual_elsewhere(const TargetView& view, capture::Timestamp set_at,
                                                 const MotionState& state, SeenRegions& seen);
  std::optional<EpipolarResidual> pair_residual(const Sighting& i, const Sighting& j, const MotionState& state) const;
  void compare_residuals(const MotionState& state);

  double radius_m_;
  ObjectTrackerOptions options_;
  EpipolarConsistency epipolar_;
  std::vector<PathResidual> residuals_;                       // work space
  std::size_t compared_sets_ = 0;                             // since the object was found
  std::vector<Eigen::Matrix<double, 6, 6>> pose_covariance_;  // per camera, CameraTrust
  bool has_pose_covariance_ = false;
  std::vector<Unseen> unseen_;                // per camera
  std::vector<bool> is_shared_;               // per camera
  std::vector<color::RegionFinder> finders_;  // per camera
};

// Sets ViewSupport::leave_one_out of each view in `seen`, predicted by the other views in `used`. anywhere_m: sigma of
// a position of which nothing is known.
void add_leave_one_out(const MotionState& state, double radius_m, double acceleration_m_s2, double anywhere_m,
                       std::span<const Sighting> seen, std::span<const Sighting> used, ObjectEstimate& estimate);

}  // namespace huetrack::object_tracking
