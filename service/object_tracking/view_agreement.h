// Whether the views of an object agree with one another, and what is held of each camera because of it: doubt, and the
// poses that were found otherwise (CameraTrust). What doubts are made of: view_doubts.h.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/motion_belief.h"
#include "object_tracking/seen_regions.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"
#include "object_tracking/view_doubts.h"

namespace huetrack::object_tracking {

// thread-compatible.
class ViewAgreement {
 public:
  ViewAgreement(std::size_t cameras, double radius_m, const ObjectTrackerOptions& options);

  // ObjectTracker::trust(): cameras whose past says nothing any more, and all that is held of poses.
  void trust(std::span<const std::size_t> changed, std::span<const CameraTrust> cameras);
  // What views showed of one another was seen by times that are known to be wrong by now.
  void forget();

  // Every view with every other one, before one of them is left out; then each sighting, and each of `watched` (by
  // cameras that are not used), is doubted by what came of it. Notes in `seen` what was looked at.
  void compare(const std::vector<TargetView>& views, capture::Timestamp set_at, const MotionBelief& belief,
               std::vector<Sighting>& sightings, std::vector<Sighting>& watched, SeenRegions& seen);
  // compare() of one of several objects that is tracked: of what else views show nobody knows whether it is this one.
  void compare_sightings(const MotionBelief& belief, std::span<const Sighting> sightings);
  // The object was found just now by these.
  void compare_found(const MotionBelief& belief, std::vector<Sighting>& sightings);
  // What the views show of an object that is not found: where each has one thing that moves, they must agree about it.
  // So the views of a rig that is another one are doubted before something is found that is not there. regions[i]
  // belongs to views[i], expected_px[i] is about the object's radius in it.
  void compare_searched(const std::vector<TargetView>& views, std::span<const std::vector<color::ColorRegion>> regions,
                        std::span<const double> expected_px, capture::Timestamp set_at, const MotionBelief& belief);

  // In this camera the room shares the colour: what moves in it as a whole says nothing of whether views agree.
  void set_shared(std::size_t camera, bool is_shared) { is_shared_[camera] = is_shared; }

  // How far each of them may be off in every frame alike.
  void doubt(const MotionBelief& belief, std::vector<Sighting>& sightings) const;
  // Adds what doubt() knows to what is open of an object there.
  void open(std::size_t camera, const calib::Camera& in_view, const Eigen::Vector3d& position, const Appearance& at,
            Eigen::Matrix2d& covariance) const;
  // What doubted views leave open of the position, standard deviation along the largest axis; 0: no view is doubted.
  double doubted_sigma(const MotionBelief& belief, std::span<const Sighting> sightings) const;
  // Views contradict one another, and there is none to believe.
  bool is_nobody_believed() const { return doubts_.is_nobody_believed(); }
  double doubt_px2(std::size_t camera) const { return doubts_.variance_px2(camera); }

 private:
  // A view that should show the object and does not, or that is searched.
  struct Unseen {
    unsigned sets = 0;                                       // one after the other
    std::vector<color::ColorRegion> older = {}, newer = {};  // in the whole image, when it was looked at before
    capture::Timestamp older_at{}, newer_at{};
    bool is_suspicious = false;  // something moved in it when it was last looked at
  };
  std::optional<SeenBeside> beside(const Sighting& sighting, const MotionBelief& belief) const;
  const color::ColorRegion* only_moving(int camera, std::span<const color::ColorRegion> regions, double radius_px,
                                        capture::Timestamp at);
  std::optional<SeenBeside> far_off(const TargetView& view, capture::Timestamp set_at, const MotionBelief& belief,
                                    SeenRegions& seen);
  std::optional<Disagreement> disagreement_of(const Sighting& i, const Sighting& j, const MotionBelief& belief) const;
  void compare_besides(const MotionBelief& belief);

  double radius_m_;
  ObjectTrackerOptions options_;
  ViewDoubts doubts_;
  std::vector<SeenBeside> besides_;                           // while views are compared
  unsigned compared_sets_ = 0;                                // since the object was found
  std::vector<Eigen::Matrix<double, 6, 6>> pose_covariance_;  // per camera, CameraTrust
  bool has_pose_covariance_ = false;
  std::vector<Unseen> unseen_;                // per camera
  std::vector<bool> is_shared_;               // per camera
  std::vector<color::RegionFinder> finders_;  // per camera
};

// Each view of `seen` that shows the object beside what those of `used` say without it, on the path that is believed
// now: ViewSupport::witness of its camera in the estimate. anywhere_m: as far as anything can be.
void add_witnesses(const MotionBelief& belief, double radius_m, double acceleration_m_s2, double anywhere_m,
                   std::span<const Sighting> seen, std::span<const Sighting> used, ObjectEstimate& estimate);

}  // namespace huetrack::object_tracking
