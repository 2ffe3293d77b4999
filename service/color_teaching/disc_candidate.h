// A disc in a picture that may be the object: how well its colour fits, its place and its size. Pure functions.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "calib/model/camera_rig.h"
#include "color_teaching/disc_contrast.h"

namespace huetrack::color_teaching {

// Costs are squared normalised residuals: the most that a candidate may cost, and the least lead over the next best.
inline constexpr double largest_cost = 12, clear_lead = 4;
// Cost of a view in which the object is hidden. The most that a candidate may cost leads over that.
inline constexpr double hidden_cost = largest_cost + clear_lead;
inline constexpr double size_step = 0.2;  // sizes are tried in steps of a natural logarithm

inline constexpr double around_volume_m = 0.1;  // in which an object may be, too

// Share of a disc's pixels that moved, below which it rests.
inline constexpr double still_share = 0.25;

// The object's colour, how much that differs within it, and whether it moves.
struct Look {
  Tint tint;
  double spread;
  std::optional<bool> is_moving;
};
// Of its pixels.
Look look_of(const std::vector<color::Hsi>& object);

struct Candidate {
  TintDisc disc;
  DiscContrast contrast;
  double cost = 0;  // without that of its place and size
};

// Where the disc's colour lies best, from there: mean shift. nullopt: not like the object. moving: null: unknown.
std::optional<Candidate> settled(const TintImage& image, const PixelMask* moving, TintDisc disc, const Look& look);

double share_inside(const PixelMask& mask, const TintDisc& disc);

double cost_of_size(double ratio);  // of radii, its own and the expected
double radius_px_of(const calib::Camera& camera, const Eigen::Vector3d& position, double radius_m);
// The click and the calibration have errors of some pixels, and frames of nearly one moment of a radius.
double slack_px_of(const calib::Camera& camera, const Eigen::Vector3d& position, double radius_px, double moved_m);

// The costs of a view's candidates, by their index, if the object is there, each below hidden_cost.
std::vector<std::pair<std::size_t, double>> costs_at(const calib::Camera& camera,
                                                     const std::vector<Candidate>& candidates,
                                                     const Eigen::Vector3d& position, double radius_m, double moved_m);

}  // namespace huetrack::color_teaching
