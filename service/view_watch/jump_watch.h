// Detects pictures that are not in the order in which they were taken: the object jumps between two frame sets, in all
// views at once, again and again, and moves smoothly in between.
#pragma once

#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "object_tracking/object_estimate.h"

namespace huetrack::view_watch {

struct Jumps {
  int count = 0;         // in the last seconds
  double seconds = 0;    // from the first of them to the last
  double largest_m = 0;  // across the view, by the object's radius
};

// thread-compatible; one per target of one object.
class JumpWatch {
 public:
  explicit JumpWatch(std::size_t cameras) : last_(cameras) {}

  // After each set, in time order. Of a camera's regions the largest is the object, if it is about as large as in the
  // set before.
  void look(std::span<const object_tracking::SeenRegion> regions, double now_s, double radius_m);

  // nullopt: none, or few enough to be chance.
  std::optional<Jumps> jumps() const;

 private:
  struct Largest {  // of a camera's regions, last seen
    Eigen::Vector2d px = Eigen::Vector2d::Zero();
    double radius_px = 0;  // 0: none
    double at_s = 0;
    bool is_target = false;
  };
  struct Step {  // from the set before that shows the object; after a jump the tracker looks elsewhere for some sets
    double at_s;
    double radii;       // the smallest of all views, in radii of the object
    double speed;       // radii / s
    bool is_of_target;  // in every view
  };
  struct Jump {
    double at_s, size_m;
  };
  std::vector<Largest> last_;
  std::deque<Step> steps_;  // the last ones
  std::deque<Jump> jumps_;
};

}  // namespace huetrack::view_watch
