// Estimates each camera's latency and readout time from one object's motion: its measurements since it was initialised
// are kept, and filtered again when the timing has moved away from where it was linearised.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <deque>
#include <span>
#include <vector>

#include "object_tracking/motion_observer.h"
#include "object_tracking/motion_state.h"
#include "object_tracking/sighting.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::object_trackers {

struct TimingEstimatorTuning {
  double at_rest_m_s = 0.3;     // slower, timing hardly matters: 6 mm at 20 ms
  std::size_t most_sets = 300;  // ten seconds at 30 sets a second; a pass over them takes some 10 ms
  int passes = 3;               // of the iterated filter (experiment)
  int sets_until_again = 75;    // moving ones after which it is linearised again
};
inline constexpr TimingEstimatorTuning timing_tuning{};

// The time of some of these rows is so uncertain (1 sigma over `same_time_s`: at some m/s, as many mm as all else
// leaves open) that a moving object is not localised.
bool are_times_open(std::span<const object_tracking::Sighting> sightings, const object_tracking::MotionState& motion);

// thread-compatible.
class TimingEstimator {
 public:
  TimingEstimator(std::size_t cameras, const object_tracking::TargetOptions& target,
                  const object_tracking::ObjectTrackerOptions& options);

  void begin(const object_tracking::MotionState& motion);   // a new object; motion: the timing without it
  void settle(const object_tracking::MotionState& motion);  // sets all remembered states to this one
  // Keeps a set's measurements and the state after it. Returns whether to call linearise_again().
  bool remember(const object_tracking::MotionState& motion, std::span<const object_tracking::Sighting> sightings,
                double power_density);
  // Filters all remembered sets again with the timing known now: an iterated extended Kalman filter (Bell and Cathey
  // 1993), each pass linearised where the one before ended.
  void linearise_again(object_tracking::MotionState& motion, double power_density);
  void add_times(const object_tracking::TimesInformation& shown);  // by other objects: MotionState::add_times()
  void forget_seen();  // a camera's pose changed: what was measured is of another rig

 private:
  std::vector<Eigen::Vector3d> smooth_velocities() const;

  bool is_learning_;
  double speed_m_s_, anywhere_m_;
  object_tracking::MotionObserver observer_;
  std::optional<object_tracking::MotionState> begun_;  // the timing before the object was found
  struct SeenSet {
    double power_density;
    std::vector<object_tracking::Sighting> sightings;
    capture::Timestamp estimated_at;  // of the state after it
    Eigen::Vector3d position, velocity;
  };
  std::deque<SeenSet> seen_sets_;      // while the timing may change
  int moving_sets_ = 0;                // among them, since linearise_again()
  bool is_forgetting_motion_ = false;  // seen_sets_ was given up: its information on timing is only in the state
};

}  // namespace huetrack::object_trackers
