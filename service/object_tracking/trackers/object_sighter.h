// What the views show of one object, near where it is expected.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/expected_view.h"
#include "object_tracking/outline_sighter.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"
#include "object_tracking/trackers/object_filter.h"
#include "object_tracking/view_consistency.h"

namespace huetrack::object_trackers {

// How far from there the view may show the object, px^2: by what is believed of it, and by twice the hardest usual
// acceleration, whatever the filter has learnt, so that a throw does not lose it.
Eigen::Matrix2d spread_in(const object_tracking::TargetView& view, const object_tracking::ExpectedView& expected,
                          const ObjectFilter& filter, const object_tracking::ViewConsistency& agreement,
                          double acceleration_m_s2);

// thread-compatible.
class ObjectSighter {
 public:
  ObjectSighter(const calib::CameraRig& rig, const object_tracking::TargetOptions& target,
                const object_tracking::ObjectTrackerOptions& options)
      : radius_m_(target.radius_m),
        options_(options),
        outlines_(rig, target, options),
        last_(rig.cameras.size()),
        finders_(rig.cameras.size()),
        regions_(rig.cameras.size()) {}

  // In each view the region near the prediction that explains it best, if there is one, or the outline there; by the
  // times of their rows.
  void sight(const std::vector<object_tracking::TargetView>& views, const ObjectFilter& filter,
             const object_tracking::ViewConsistency& agreement, std::vector<object_tracking::Sighting>& out);
  // The object bounced, or was hit or thrown, since the last set: it may be wherever an acceleration of this power
  // density takes it. More views than `least` that see it in one such place are believed at once; fewer are not.
  // Returns whether there are; after sight() in the same set.
  bool sight_after_bounce(const std::vector<object_tracking::TargetView>& views,
                          const object_tracking::TargetOptions& target, const object_tracking::MotionState& belief,
                          double power_density, std::size_t least, std::vector<object_tracking::Sighting>& out);

  // Sightings that were made from regions where nothing was expected, once it is known what they are of. about: as far
  // as that is known by them.
  void sharpen(const std::vector<object_tracking::TargetView>& views, const object_tracking::MotionState& about,
               std::vector<object_tracking::Sighting>& sightings);
  // After a set in which the object is tracked: what is behind it, for outlines to come.
  void learn_behind(const std::vector<object_tracking::TargetView>& views,
                    const object_tracking::MotionState& belief) {
    outlines_.learn(views, belief);
  }
  const object_tracking::OutlineSighter& outlines() const { return outlines_; }

 private:
  struct LastRegion {
    color::ColorRegion region = {};
    capture::Timestamp captured_at{};
    bool is_repeated = false;
  };
  std::span<const color::ColorRegion> regions_near(const object_tracking::TargetView& view,
                                                   const object_tracking::BallProjection& at,
                                                   const Eigen::Matrix2d& spread);
  bool is_repeated(const object_tracking::TargetView& view, std::span<const color::ColorRegion> regions,
                   const object_tracking::BallProjection& at, const object_tracking::MotionState& belief);

  double radius_m_;
  object_tracking::ObjectTrackerOptions options_;
  object_tracking::OutlineSighter outlines_;
  std::vector<LastRegion> last_;                          // per camera: what was sighted last
  std::vector<color::RegionFinder> finders_;              // per camera
  std::vector<color::ColorRegion> near_;                  // of the view looked at
  std::vector<std::vector<color::ColorRegion>> regions_;  // of the views of this set, after a bounce
};

}  // namespace huetrack::object_trackers
