// Fits discs of known radii to one region of their colour: balls that occlude one another, or are partly occluded.
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
  double reach_px = 0;  // 1 sigma of px, per axis
};

struct FittedDisc {
  Eigen::Vector2d px;
  Eigen::Matrix2d covariance;  // px^2, of px, by the visible outline
  double seen = 0;             // 0..1, share of the outline
  double passed = 0;           // 0..1, share across which the colour continues outside of all discs
};

// Outline points: where the colour ends along a disc's normals, except inside another disc; a colour that ends well
// inside or continues outside gives none. They move the disc (Gauss-Newton, Huber weights). The radius is an unknown
// with a prior of a fraction of a pixel, as thresholds and shading change it; a fixed one would pull an arc outwards.
// nullopt: no outline is visible, or that of something else.
std::vector<std::optional<FittedDisc>> fit_discs(color::MatchBits& bits, std::span<const ExpectedDisc> discs);

}  // namespace huetrack::objects
