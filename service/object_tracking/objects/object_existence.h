// Existence probability of a track: integrated probabilistic data association (IPDA; Musicki, Evans, Stankovic 1994)
// with hard association. State: log-odds of target over clutter. The clutter's density: clutter_map.h.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "object_tracking/motion_state.h"
#include "object_tracking/objects/clutter_map.h"
#include "object_tracking/objects/object_births.h"
#include "object_tracking/objects/static_clutter_mask.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"

namespace huetrack::objects {

// Predicted position at a time, and how it goes on.
struct ExpectedPlace {
  Eigen::Vector3d position;
  Eigen::Matrix3d covariance;
  capture::Timestamp at;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  Eigen::Matrix3d velocity_covariance = Eigen::Matrix3d::Zero();
};

// thread-compatible; one per object.
class ObjectExistence {
 public:
  // From its first two sets.
  void begin(capture::Timestamp set_at, const Birth& birth, const std::vector<object_tracking::TargetView>& views,
             double radius_m, const object_tracking::ObjectTrackerOptions& options,
             const object_tracking::MotionState& times, const ClutterMap& clutter, const StaticClutterMask& still);
  // By one frame set, before the filter's update; power_density: that of the filter.
  void update(capture::Timestamp set_at, const object_tracking::MotionState& state, double power_density,
              std::span<const object_tracking::Sighting> sightings,
              const std::vector<object_tracking::TargetView>& views, double radius_m, const ClutterMap& clutter,
              const StaticClutterMask& still);
  // Confirmed, and supported by this set.
  bool is_sure() const;
  // Clutter explains the last set's sightings better: they are no measurement of this object.
  bool is_chance() const { return is_chance_; }
  double log_odds() const { return evidence_; }
  // Never confirmed, and less likely than when it was found, or at rest for too long. A confirmed one coasts instead.
  bool is_refuted() const;

 private:
  double evidence_ = 0;  // log-odds
  double at_first_ = 0;  // when it was found; < 0: clutter was likelier, and only a moving object can be confirmed
  Eigen::Vector3d found_at_ = Eigen::Vector3d::Zero();
  capture::Timestamp found_when_{};
  bool has_moved_ = true;  // by its diameter
  bool is_overdue_ = false;
  double of_set_ = 0;
  bool is_chance_ = false;
  bool has_been_sure_ = false;
};

}  // namespace huetrack::objects
