// Consistency checks of a joint adjustment. Small residuals do not suffice: wrong lenses and poses can absorb a bent
// board or a camera that moved.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calib/solver/bundle_adjustment.h"

namespace huetrack::solver {

// Split-half test: both halves are adjusted separately, and compared over the volume.
struct HalvesCheck {
  enum class Split {
    in_time,      // the first half of the recording against the second
    in_place,     // boards at one end of the volume against those at the other
    alternating,  // every second piece of the recording
  };
  Split split = Split::in_time;
  double seen_m = 0;      // half of the rms difference: an estimate of the error of the whole
  double expected_m = 0;  // the same by the halves' covariances
  double ratio() const { return expected_m > 0 ? seen_m / expected_m : 0; }
};
// Splits with enough views in both halves.
std::vector<HalvesCheck> compare_halves(const Adjustment& adjusted);

// Largest ratio by chance (few directions of error dominate).
inline constexpr double most_halves_ratio = 1.6;
// Multiplies the covariance by the squared ratio of the worst split, if above most_halves_ratio.
void widen_by(Adjustment& adjusted, const std::vector<HalvesCheck>& halves);

// A camera that moved during the recording.
struct MovedWithin {
  int camera = 0;
  int set = 0;        // the first one after the motion
  std::string image;  // its image in that set, for messages
  double moved_m = 0, turned_rad = 0;
  bool is_either_of_two = false;  // two cameras only: which of them moved is not observable
};
// nullopt: none, significantly. Uses all views of boards at rest, dropped ones included.
std::optional<MovedWithin> find_moved_within(const Adjustment& adjusted);

}  // namespace huetrack::solver
