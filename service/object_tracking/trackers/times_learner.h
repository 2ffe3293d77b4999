// When each camera's rows are exposed, learnt from one object's motion: what was seen of it since it was found is kept,
// and gone through again when the times turn out to be others than those that it was linearised at.
#pragma once

#include <Eigen/Core>
#include <deque>
#include <span>
#include <vector>

#include "object_tracking/motion_state.h"
#include "object_tracking/motion_observer.h"
#include "object_tracking/sighting.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::object_trackers {

// Slower than this, times hardly matter: 6 mm at 20 ms.
inline constexpr double at_rest_m_s = 0.3;

// Some of these rows were exposed at times that are not known: nobody knows where a moving object is.
bool are_times_open(std::span<const object_tracking::Sighting> sightings, const object_tracking::MotionState& belief);

// thread-compatible.
class TimesLearner {
 public:
  TimesLearner(double radius_m, const object_tracking::ObjectTrackerOptions& options);

  // A new object, found in two sets. What is believed of the times now is known without it.
  void begin(const object_tracking::MotionState& belief);
  // All that has been remembered since begin() is best told by what is believed now.
  void settle(const object_tracking::MotionState& belief);
  // The sightings of a set, and what came of them. Returns whether what is remembered now tells more of the times than
  // was made of it.
  bool remember(const object_tracking::MotionState& belief, std::span<const object_tracking::Sighting> sightings,
                double power_density);
  // All that was seen since the object was found is gone through once more, with rows' times as they are known now: an
  // iterated extended Kalman filter (Bell and Cathey 1993), whose every pass begins where the one before has ended.
  void linearise_again(object_tracking::MotionState& belief, double power_density);
  // A camera stands elsewhere: what was seen so far was seen by another rig.
  void forget_seen();

 private:
  std::vector<Eigen::Vector3d> smooth_velocities() const;

  bool is_learning_;
  double speed_m_s_, anywhere_m_;
  object_tracking::MotionObserver observer_;
  std::optional<object_tracking::MotionState> begun_;  // what was known of the times before the object was found
  struct SeenSet {
    double power_density;
    std::vector<object_tracking::Sighting> sightings;
    capture::Timestamp believed_at;  // what was believed of the motion after it
    Eigen::Vector3d position, velocity;
  };
  std::deque<SeenSet> seen_sets_;      // as long as the times may turn out to be others
  int moving_sets_ = 0;                // among them, since the times were linearised again
  bool is_forgetting_motion_ = false;  // seen_sets_ had to be given up: what they told of times is only in the belief
};

}  // namespace huetrack::object_trackers
