// A belief of motion, and the sightings of one set: the Kalman update in the order of the rows' times.
#pragma once

#include <span>
#include <vector>

#include "object_tracking/motion_state.h"
#include "object_tracking/sighting.h"

namespace huetrack::object_tracking {

// A sighting as it was linearised.
struct LinearView {
  const Sighting* sighting;
  LinearSighting linear;
};

// thread-compatible: keeps its work space.
class MotionObserver {
 public:
  explicit MotionObserver(double radius_m) : radius_m_(radius_m) {}

  // The belief after the sightings (by the times of their rows), each at its own time. linearised_about: a motion near
  // the object's; nullptr: as it is expected to go on. power_density: of the acceleration, m^2/s^3.
  MotionState observed(const MotionState& from, const MotionState* linearised_about,
                       std::span<const Sighting> sightings, double power_density);
  // Linearised again where the object turns out to be, when that is not where it was expected (Bell and Cathey 1993).
  // What a single view leaves open must be the ray through its pixel, to a fraction of the pixel over all of the open
  // depth, or particles along the wrong line make the filter sure of a depth that nobody measured.
  MotionState observed_in_passes(const MotionState& from, std::span<const Sighting> sightings, double power_density);

  // Of the last call. The views point into its sightings.
  const std::vector<LinearView>& views() const { return views_; }
  double surprise() const { return surprise_; }  // mean squared innovation in its standard deviations; usually 1

 private:
  double radius_m_;
  std::vector<LinearView> views_;
  double surprise_ = 0;
};

}  // namespace huetrack::object_tracking
