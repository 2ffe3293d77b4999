// Maximum-likelihood rotation, or focal length, of one camera; the others are fixed. Pure functions.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "view_watch/pair_residuals.h"

namespace huetrack::view_watch {

struct BestTurn {
  Eigen::Vector3d turn_rad;  // cam_from_world = exp(turn) * the rig's
  // Decrease of the cost: chi-square, 3 dof, relative to the residual noise after the turn; one sample per
  // place.
  double gain;
};
// nullopt: there are no samples.
std::optional<BestTurn> best_turn(const PairComparison& comparison, const std::vector<Track>& tracks,
                                  std::size_t camera, const TimeSigmas& times);

struct BestZoom {
  double zoom;  // ratio to the rig's focal length, 0.6..1.6
  double gain;  // chi-square, 1 degree of freedom
};
BestZoom best_zoom(const PairComparison& comparison, const std::vector<Track>& tracks, std::size_t camera,
                   const TimeSigmas& times);

}  // namespace huetrack::view_watch
