// What a joint adjustment says against itself: facts that its residuals alone do not show. A small residual says that
// the model follows the views, not that the views are right: a board that is bent, or a camera that was moved, can be
// followed by lenses and poses that are wrong.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calib/solver/bundle_adjustment.h"

namespace huetrack::solver {

// Two halves of the moments, each adjusted by itself, and how far they disagree on the places of the volume.
struct HalvesCheck {
  enum class Split {
    in_time,      // the first half of the recording against the second
    in_place,     // boards at one end of the volume against those at the other
    alternating,  // every second piece of the recording
  };
  Split split = Split::in_time;
  // rms over the volume of what the halves' places differ by, as an error of the whole: about half of the difference.
  double seen_m = 0;
  double expected_m = 0;  // by the halves' covariances
  double ratio() const { return expected_m > 0 ? seen_m / expected_m : 0; }
};
// Those splits that leave enough in both halves.
std::vector<HalvesCheck> compare_halves(const Adjustment& adjusted);

// Halves may differ by chance: by so much they hardly do (few directions of error carry most of it).
inline constexpr double most_halves_ratio = 1.6;
// Widens the covariance by how far the worst of the splits disagrees, where that is more than chance.
void widen_by(Adjustment& adjusted, const std::vector<HalvesCheck>& halves);

// A camera that stood elsewhere before a moment than from then on.
struct MovedWithin {
  int camera = 0;
  int set = 0;                         // the first one after it moved
  std::string image;                   // of the camera, in that set or the next one that it is in: for messages
  double moved_m = 0, turned_rad = 0;  // of its centre, and as a whole
  bool is_either_of_two = false;       // two cameras only: it cannot be told which of them moved
};
// nullopt: none clearly did. All views of boards at rest count, those too that were dropped as outliers.
std::optional<MovedWithin> find_moved_within(const Adjustment& adjusted);

}  // namespace huetrack::solver
