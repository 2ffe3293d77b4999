// Kalman update of a motion state by the sightings of one frame set, in the order of their rows' times.
#pragma once

#include <optional>
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
  // is_ball: with one camera, its radius in the image is a measurement, too.
  MotionObserver(double radius_m, bool is_ball) : radius_m_(radius_m), is_ball_(is_ball) {}

  // The state after the sightings, which are sorted by time. linearised_about: a motion near the object's; nullptr: the
  // prediction. power_density: of the acceleration, m^2/s^3.
  MotionState observed(const MotionState& from, const MotionState* linearised_about,
                       std::span<const Sighting> sightings, double power_density);
  // Iterated (Bell and Cathey 1993) while the position moves: a single view's open direction must be the ray through
  // its pixel over the whole depth, or particles along a wrong line reduce the variance of a depth that was not
  // measured. With one camera not iterated: the posterior's place is most likely where the object is nearest.
  MotionState observed_in_passes(const MotionState& from, std::span<const Sighting> sightings, double power_density);

  // Of the last call. The views point into its sightings.
  const std::vector<LinearView>& views() const { return views_; }
  // With one camera: whether the last measured radius was as expected; nullopt: none was measured.
  std::optional<bool> is_size_consistent() const { return is_size_consistent_; }
  double mean_nis() const { return mean_nis_; }  // mean NIS per degree of freedom; 1 if the model holds

 private:
  double radius_m_;
  bool is_ball_;
  std::optional<bool> is_size_consistent_;
  std::vector<LinearView> views_;
  double mean_nis_ = 0;
};

}  // namespace huetrack::object_tracking
