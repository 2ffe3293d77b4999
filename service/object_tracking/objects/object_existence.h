// Existence probability of a track: integrated probabilistic data association (IPDA; Musicki, Evans, Stankovic 1994)
// with hard association. State: log-odds of target over clutter. The clutter's density: clutter_map.h.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <span>
#include <utility>
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

// Probabilistic data association (Bar-Shalom and Tse 1975) as an addition to a measurement's covariance, px^2. spread:
// S, of the innovation d; probability: b, that the measurement is the object's. The gain becomes PDA's, b K, less the
// share (1 - b) d^T S^-1 d: by that much its spread of the innovations, b (1 - b) K d d^T K^T, widens the posterior.
Eigen::Matrix2d association_px2(const Eigen::Matrix2d& spread, const Eigen::Vector2d& d, double probability);

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
  // Before the views are compared, in a room that shares the colour: takes out the sightings that are clutter's rather
  // than the object's. Those of an object that is not confirmed are no evidence against a camera (Sighting::is_cut).
  void leave_out_chance(const object_tracking::MotionState& state, double power_density,
                        const std::vector<object_tracking::TargetView>& views, double radius_m,
                        const ClutterMap& clutter, const StaticClutterMask& still,
                        std::vector<object_tracking::Sighting>& sightings) const;
  // After update(): the set shows another place of the one object, with these log-odds, >= 0.
  void compete(double log_odds) { evidence_ -= log_odds, of_set_ -= log_odds; }
  // Confirmed, and supported by this set.
  bool is_sure() const;
  // The last set alone would confirm it.
  bool is_evident() const;
  // The clutter likelihood of the camera's sighting in the last set exceeds the target likelihood: it is no measurement
  // of this object.
  bool is_chance(int camera) const { return std::ranges::count(chance_, camera) > 0; }
  // association_px2() of the camera's sighting in the last set, in a room that shares the colour; else 0.
  Eigen::Matrix2d chance_px2(int camera) const;
  double log_odds() const { return evidence_; }
  // Never confirmed, and less likely than when it was found, or at rest for too long. A confirmed one coasts instead.
  bool is_refuted() const;

 private:
  struct FirstSeen {
    int camera;
    Eigen::Vector2d px;
  };
  double evidence_ = 0;  // log-odds
  double at_first_ = 0;  // when it was found; < 0: clutter was likelier, and only a moving object can be confirmed
  std::vector<FirstSeen> first_ = {};  // per camera, since it was found
  capture::Timestamp found_when_{};
  bool has_moved_ = true;  // by its radius, in two views
  bool is_overdue_ = false;
  double of_set_ = 0;
  std::vector<int> chance_ = {};                              // is_chance()
  std::vector<std::pair<int, Eigen::Matrix2d>> doubts_ = {};  // chance_px2(), per camera
  bool has_been_sure_ = false;
};

// In a room that shares the colour: something else in this picture looks as the sighting does. Far from the prediction
// it is that rather than the object, seen by a camera that was moved.
bool may_be_clutter(const object_tracking::Sighting& sighting, const ClutterMap& clutter,
                    const StaticClutterMask& still);

}  // namespace huetrack::objects
