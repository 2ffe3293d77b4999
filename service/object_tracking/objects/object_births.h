// Track initiation among several objects of one colour: triangulates regions that no known object explains. Ghosts,
// crossings of rays of different objects, are rejected by further views, by the regions' sizes, and because a region
// belongs to one object.
#pragma once

#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/motion_state.h"
#include "object_tracking/objects/clutter_map.h"
#include "object_tracking/objects/static_clutter_mask.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::objects {

struct Birth {
  object_tracking::PositionCandidate earlier, now;
  double dt;            // from one to the other, seconds
  double of_shape = 0;  // log-likelihood ratio of `now`: discs of its size against clutter of any size and shape
};

// The volume and what is at most as far from it as an object moves until it is confirmed: objects about to enter are
// tracked, and explain their regions.
object_tracking::Volume looked_through(const object_tracking::ObjectTrackerOptions& options);

// A known object in a view; it may occlude others.
struct CoveredDisc {
  std::size_t view;  // which of the views
  Eigen::Vector2d px;
  double radius_px;
};
// Where the views show an object that is there.
void add_covered(const std::vector<object_tracking::TargetView>& views,
                 std::span<const object_tracking::Sighting> sightings, const Eigen::Vector3d& position, double radius_m,
                 std::vector<CoveredDisc>& out);

// thread-compatible.
class ObjectBirths {
 public:
  // within: the volume that is searched.
  ObjectBirths(const object_tracking::TargetOptions& target, const object_tracking::ObjectTrackerOptions& options,
               const object_tracking::Volume& within);

  // Finds: candidates of this set that one of the last set explains. regions[i], unexplained, belong to views[i]. Of
  // `times` only the timing is used. Where the mask `still` may cut an object, a missed detection is no evidence.
  std::vector<Birth> look(const std::vector<object_tracking::TargetView>& views,
                          std::span<const std::vector<color::ColorRegion>> regions,
                          std::span<const CoveredDisc> covered, const ClutterMap& clutter,
                          const StaticClutterMask& still, capture::Timestamp set_at,
                          const object_tracking::MotionState& times);
  void forget() { before_.clear(); }
  // The regions of the last set's candidates are clutter only as far as these are not objects.
  void claim(ClutterMap& clutter) const;
  // Natural logarithm of the odds that the likeliest candidate of the last set that is elsewhere is the object, by that
  // set; 0: none.
  double best_evidence_besides(const Eigen::Vector3d& position) const;

 private:
  struct Candidate {
    object_tracking::PositionCandidate at;
    double evidence = 0;
    bool is_ambiguous = false;  // its regions may belong to another candidate
  };
  std::vector<Candidate> candidates(const std::vector<object_tracking::TargetView>& views,
                                    std::span<const std::vector<color::ColorRegion>> regions,
                                    std::span<const CoveredDisc> covered, const ClutterMap& clutter,
                                    const StaticClutterMask& still, const object_tracking::MotionState& times) const;
  Candidate weighed(object_tracking::PositionCandidate at, const std::vector<object_tracking::TargetView>& views,
                    std::span<const std::vector<color::ColorRegion>> regions, std::span<const CoveredDisc> covered,
                    const ClutterMap& clutter, const StaticClutterMask& still) const;

  object_tracking::TargetOptions target_;
  object_tracking::ObjectTrackerOptions options_;  // with the volume that is searched
  std::vector<Candidate> before_;
  std::vector<Candidate> now_;  // of the last set
  capture::Timestamp before_at_{};
};

}  // namespace huetrack::objects
