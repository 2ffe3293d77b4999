// New objects among several of one colour: rays crossed between views through the regions that no known object
// explains. The trap are ghosts, crossings of rays of different objects. What tells them apart: a third view sees them
// or does not, regions have the size that an object has there, and one region is not of two objects that are apart.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/motion_belief.h"
#include "object_tracking/objects/still_color.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::objects {

struct DetectionTuning {
  double probability = 0.9;  // P_D: a view detects an object that should be visible; else something unknown hides it
};
inline constexpr DetectionTuning detection{};

struct Birth {
  object_tracking::PositionCandidate earlier, now;
  double dt;  // from one to the other, seconds
};

// Around a volume, half its largest extent: who comes in is known by then, and so is what he shows.
object_tracking::Volume looked_through(const object_tracking::Volume& volume);

// Where a known object covers a view: what is not seen there may be behind it.
struct CoveredDisc {
  std::size_t view;  // which of the views
  Eigen::Vector2d px;
  double radius_px;
};

// Whether one that stands where it was first seen may be an object (StillColor::is_starting()).
enum class MustMove : std::uint8_t {
  no,
  unless_clear,  // not what is beyond chance: two views show a whole disc of the right size, or three show it
  yes,           // what stands is none, however clear it is
};
MustMove must_move(const StillColor& still, capture::Timestamp set_at);

// thread-compatible.
class ObjectBirths {
 public:
  // within: where objects are looked for.
  ObjectBirths(const object_tracking::TargetOptions& target, const object_tracking::ObjectTrackerOptions& options,
               const object_tracking::Volume& within);

  // regions[i], unexplained, belong to views[i]. Of the belief only the cameras' times are used. still: where something
  // is left out, a view need not show an object.
  std::vector<Birth> look(const std::vector<object_tracking::TargetView>& views,
                          std::span<const std::vector<color::ColorRegion>> regions,
                          std::span<const CoveredDisc> covered, const StillColor& still, capture::Timestamp set_at,
                          const object_tracking::MotionBelief& times);
  void forget() { before_.clear(); }
  void set_must_move(MustMove must_move) { must_move_ = must_move; }  // from now on

 private:
  struct Candidate {
    object_tracking::PositionCandidate at;
    Eigen::Vector3d from = at.position;  // of the one so many sets ago, or of the first
    int sets_from = 0;
    double evidence = 0;
    int missing = 0;            // views that should see it, and do not
    bool is_ambiguous = false;  // its regions may as well be of others
  };
  std::vector<Candidate> candidates(const std::vector<object_tracking::TargetView>& views,
                                    std::span<const std::vector<color::ColorRegion>> regions,
                                    std::span<const CoveredDisc> covered, const StillColor& still,
                                    const object_tracking::MotionBelief& times) const;
  Candidate weighed(object_tracking::PositionCandidate at, const std::vector<object_tracking::TargetView>& views,
                    std::span<const std::vector<color::ColorRegion>> regions, std::span<const CoveredDisc> covered,
                    const StillColor& still) const;

  object_tracking::TargetOptions target_;
  object_tracking::ObjectTrackerOptions options_;  // with the volume in which objects are looked for
  std::vector<Candidate> before_;
  MustMove must_move_ = MustMove::no;
  capture::Timestamp before_at_{};
};

}  // namespace huetrack::objects
