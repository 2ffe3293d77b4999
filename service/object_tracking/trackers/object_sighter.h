// Measures one object in each view, near its predicted position.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "color/room_colors.h"
#include "object_tracking/covered_ball.h"
#include "object_tracking/expected_view.h"
#include "object_tracking/outline_sighter.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"
#include "object_tracking/trackers/object_filter.h"
#include "object_tracking/view_consistency.h"

namespace huetrack::object_trackers {

// Covariance of the predicted image position, px^2: the state's, and twice the configured acceleration, whatever the
// filter has learnt, so that a throw stays inside of the gate.
Eigen::Matrix2d predicted_spread(const object_tracking::TargetView& view, const object_tracking::ExpectedView& expected,
                                 const ObjectFilter& filter, const object_tracking::ViewConsistency& agreement,
                                 double acceleration_m_s2);

// thread-compatible. Measurements that it returns are sorted by the time of their rows.
class ObjectSighter {
 public:
  ObjectSighter(const calib::CameraRig& rig, const object_tracking::TargetOptions& target,
                const object_tracking::ObjectTrackerOptions& options)
      : radius_m_(target.radius_m),
        options_(options),
        outlines_(rig, target, options),
        last_(rig.cameras.size()),
        usual_(rig.cameras.size()),
        finders_(rig.cameras.size()),
        disc_finders_(rig.cameras.size()),
        regions_(rig.cameras.size()) {}

  // In each view the region that best explains the prediction, refined by the outline where one can be fitted.
  void sight(const std::vector<object_tracking::TargetView>& views, const ObjectFilter& filter,
             const object_tracking::ViewConsistency& agreement, std::vector<object_tracking::Sighting>& out);
  // After sight() in the same set, if the object may have bounced, been hit or thrown: searches wherever an
  // acceleration of this power density takes it. Replaces `out` and returns true if more than `least` views see it in
  // one place.
  bool sight_after_bounce(const std::vector<object_tracking::TargetView>& views,
                          const object_tracking::TargetOptions& target, const object_tracking::MotionState& motion,
                          double power_density, std::size_t least, std::vector<object_tracking::Sighting>& out);

  // Refines measurements made without a prediction by their outlines. about: the state that they give.
  void sharpen(const std::vector<object_tracking::TargetView>& views, const object_tracking::MotionState& about,
               std::vector<object_tracking::Sighting>& sightings);
  // After a set in which the object is tracked: learns the background around it, for later outlines.
  void learn_behind(const std::vector<object_tracking::TargetView>& views, const object_tracking::MotionState& motion) {
    outlines_.learn(views, motion);
  }
  const object_tracking::OutlineSighter& outlines() const { return outlines_; }

 private:
  struct LastRegion {
    color::ColorRegion region = {};
    capture::Timestamp captured_at{};
    bool is_repeated = false;
  };
  // Logarithm of a camera's regions' radius over the expected one: shading and blur are part of it. Regions with a
  // missing part count little.
  struct UsualSize {
    double mean = 0, count = 0;
    double variance = std::pow(object_tracking::sighting_tuning.region_size_sigma, 2);  // at first: of any camera
    double missing(double log_size) const;  // share of the area, beyond the spread of the sizes
    void add(double log_size);
  };
  std::span<const color::ColorRegion> regions_near(const object_tracking::TargetView& view,
                                                   const object_tracking::BallProjection& at,
                                                   const Eigen::Matrix2d& spread);
  void measure_covered(const object_tracking::TargetView& view, const object_tracking::BallProjection& at,
                       const object_tracking::MotionState& motion, object_tracking::Sighting& sighting);
  std::optional<object_tracking::Sighting> outline_of_merged(const object_tracking::TargetView& view,
                                                             const object_tracking::MotionState& motion,
                                                             const object_tracking::ExpectedView& expected,
                                                             const Eigen::Matrix2d& spread);
  bool is_repeated(const object_tracking::TargetView& view, std::span<const color::ColorRegion> regions,
                   const object_tracking::BallProjection& at, const object_tracking::MotionState& motion);

  double radius_m_;
  object_tracking::ObjectTrackerOptions options_;
  object_tracking::OutlineSighter outlines_;
  std::vector<LastRegion> last_;                          // per camera
  std::vector<UsualSize> usual_;                          // per camera
  std::vector<color::RegionFinder> finders_;              // per camera
  object_tracking::CoveredBall covered_;                  // in any view
  std::vector<color::DiscFinder> disc_finders_;           // per camera
  std::vector<color::ColorRegion> near_;                  // work space of regions_near()
  std::vector<std::vector<color::ColorRegion>> regions_;  // work space of sight_after_bounce(), per view
};

}  // namespace huetrack::object_trackers
