// Existence probability of a track: integrated probabilistic data association (IPDA; Musicki, Evans, Stankovic 1994)
// with hard association. State: log-odds of target over clutter. The clutter density comes from a map of the regions
// that no object explains.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/motion_state.h"
#include "object_tracking/objects/object_births.h"
#include "object_tracking/objects/static_clutter_mask.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"

namespace huetrack::objects {

// Density of unassociated regions per camera and place. A set's regions count with the next add(): by then it is known
// which of them are objects. thread-compatible; one per target.
class ClutterMap {
 public:
  explicit ClutterMap(const calib::CameraRig& rig);
  // Not clutter: the regions of the last add() that these sightings are of.
  void claim(std::span<const object_tracking::Sighting> sightings);
  // regions[i]: all regions of views[i] that no known object explains.
  void add(const std::vector<object_tracking::TargetView>& views,
           std::span<const std::vector<color::ColorRegion>> regions);
  double density(std::size_t camera, const Eigen::Vector2d& px) const;  // per px^2 and set, > 0
  // Expected number of pairs of clutter in two views per set; with one camera, of regions.
  double candidates() const;

 private:
  static constexpr int cell_px = 16;  // layout: of the map
  struct PerCamera {
    int columns = 0, rows = 0;
    double pixels = 1;
    double sets = 0;                                        // in the means
    double regions = 0;                                     // per set, in the image
    std::vector<float> around;                              // per set, per cell
    std::optional<std::vector<Eigen::Vector2d>> open = {};  // centres of the last add()'s regions: not counted yet
  };
  static void count(PerCamera& of, std::span<const Eigen::Vector2d> centres);
  static double expected(const PerCamera& of);  // regions per set, in the image
  std::vector<PerCamera> cameras_;
};

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
