// Discs of known radii in one region of their colour: balls that hide one another, or that something else hides in
// part. Where a ball's outline can be seen it tells where the ball is, whatever the region's centre is made of.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "color/color_window.h"

namespace huetrack::objects {

struct ExpectedDisc {
  Eigen::Vector2d px;  // raw pixels
  double radius_px = 0;
  double reach_px = 0;  // how far from there its centre may be, as a standard deviation
};

struct FittedDisc {
  Eigen::Vector2d px;
  Eigen::Matrix2d covariance;  // px^2, of px, by the outline that was seen
  double seen = 0;             // 0..1, share of the outline
  double passed = 0;           // 0..1, share across which the colour goes on: by something that is no disc of them
};

// Outline points are where the colour ends along a disc's normals; those inside another disc of `discs` show nothing,
// and where the colour ends well inside or goes on outside, something else is before or beside it. What is left moves
// the disc (Gauss-Newton, three times) and says how well it is known, when it shows a seventh of the outline or more.
// The radius may differ by a fraction of a pixel, as thresholds and shading have it: without that, an arc would be
// pulled outwards. nullopt: too little is seen of this one.
std::vector<std::optional<FittedDisc>> fit_discs(color::MatchBits& bits, std::span<const ExpectedDisc> discs);

}  // namespace huetrack::objects
