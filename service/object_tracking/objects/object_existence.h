// Is there an object at all, in a room that has its colour, too? Whatever is left of furniture flickers at its edges,
// and something lies by chance where an object is expected, or where two rays meet. How much likelier what the views
// show is with an object there than by chance is kept per object, as a logarithm: the integrated probabilistic data
// association of Musicki, Evans and Stankovic (1994), with the association that was decided on. By chance means: as
// often as regions that are nobody's have been seen around there (a clutter map, as radars keep them).
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/motion_belief.h"
#include "object_tracking/objects/object_births.h"
#include "object_tracking/objects/still_color.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"

namespace huetrack::objects {

// How many regions that are nobody's each camera shows, and where. thread-compatible; one per target.
class ClutterMap {
 public:
  explicit ClutterMap(const calib::CameraRig& rig);
  // regions[i], which no object explains, belong to views[i], and are all that there are in its picture.
  void add(const std::vector<object_tracking::TargetView>& views,
           std::span<const std::vector<color::ColorRegion>> regions);
  double density(std::size_t camera, const Eigen::Vector2d& px) const;  // per px^2 and set, > 0

 private:
  static constexpr int cell_px = 16;  // layout: of the map
  struct PerCamera {
    int columns = 0, rows = 0;
    double pixels = 1;
    double sets = 0;            // that the mean is of
    double regions = 0;         // per set, in the whole picture
    std::vector<float> around;  // per set, per cell
  };
  std::vector<PerCamera> cameras_;
};

// Where an object is expected, or what is known of it otherwise.
struct ExpectedPlace {
  Eigen::Vector3d position;
  Eigen::Matrix3d covariance;
};

// thread-compatible; one per object.
class ObjectExistence {
 public:
  // What its first two sets say. largest_m: anywhere is so far away.
  void begin(capture::Timestamp set_at, const Birth& birth, const std::vector<object_tracking::TargetView>& views,
             double radius_m, double largest_m, const object_tracking::ObjectTrackerOptions& options,
             const ClutterMap& clutter, const StillColor& still);
  // What a set says: before the filter's update, with the power density of that.
  void update(capture::Timestamp set_at, const object_tracking::MotionBelief& belief, double power_density,
              std::span<const object_tracking::Sighting> sightings,
              const std::vector<object_tracking::TargetView>& views, double radius_m, const ClutterMap& clutter,
              const StillColor& still);
  // In a room of its own colour alone it is there: nobody asks.
  void assume();
  // It is there, this set's views show it rather than anything else, and where it is does not stand on what may be cut
  // by furniture for longer than a usual motion leaves it within a diameter of where it was.
  bool is_sure() const;
  // Chance explains what was sighted in the last set better than this object does: it says nothing of where that is.
  bool is_chance() const { return is_chance_; }
  // It never was sure, and chance explains it better: and than when it was found, for what moves. What was sure coasts,
  // like all that is not seen any more.
  bool is_refuted() const;

 private:
  double evidence_ = 0;  // logarithm of the odds
  // When it was found: below 0 chance explained that better. What moves as expected from there on is an object all the
  // same, as furniture is not.
  double at_first_ = 0;
  Eigen::Vector3d found_at_ = Eigen::Vector3d::Zero();
  capture::Timestamp found_when_{};
  bool has_moved_ = true;  // by its diameter
  bool is_overdue_ = false;
  double of_set_ = 0;
  bool is_chance_ = false;
  double on_cut_s_ = 0;  // since two views showed it whole, or its outline
  double longest_on_cut_s_ = 0;
  capture::Timestamp whole_at_{};
  bool has_been_sure_ = false;
};

}  // namespace huetrack::objects
