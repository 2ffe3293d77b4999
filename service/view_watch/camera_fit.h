// What of one camera would make it agree best with the others, which stay: a turn, or another focal length.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "view_watch/pair_residuals.h"

namespace huetrack::view_watch {

struct BestTurn {
  Eigen::Vector3d turn_rad;  // cam_from_world = exp(turn) * the rig's
  // Chi-square, 3 degrees of freedom, by which it explains more than no turn, in the noise that is left with it; one
  // sample per place.
  double gain;
};
// nullopt: none does within 15 degrees. Pure.
std::optional<BestTurn> best_turn(const PairComparison& comparison, const std::vector<Track>& tracks,
                                  std::size_t camera, const TimeSigmas& times);

struct BestZoom {
  double zoom;  // the focal length in the rig's; 0.6..1.6
  double gain;  // as of a turn; 1 degree of freedom
};
BestZoom best_zoom(const PairComparison& comparison, const std::vector<Track>& tracks, std::size_t camera,
                   const TimeSigmas& times);

}  // namespace huetrack::view_watch
