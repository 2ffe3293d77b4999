#include "object_tracking/objects/disc_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "object_tracking/sighting.h"

namespace huetrack::objects {
namespace {

struct DiscFitTuning {
  int directions = 28;         // normals on which the outline is sampled; more changes nothing (experiment)
  int passes = 3;              // Gauss-Newton steps over all discs
  double edge_sigma_px = 0.5;  // px, 1 sigma of one outline point, and of the radius: pixel grid, noise, blur
  double window_share = 0.1;   // of the radius, half width of the search along a normal beyond 2 px and the slack
};
constexpr DiscFitTuning disc_fit{};
// An outline point this near to another disc is hidden by it.
constexpr double hidden_px = object_tracking::sighting_tuning.prediction_sigmas * disc_fit.edge_sigma_px;

struct Normal {
  Eigen::Vector2d direction;
  double off_px;  // of the outline point from the disc's own
};

// nullopt: outside the image.
std::optional<bool> is_matching(color::MatchBits& bits, const Eigen::Vector2d& px) {
  const double u = std::floor(px.x() + 0.5), v = std::floor(px.y() + 0.5);
  if (!(u >= 0 && v >= 0 && u < bits.width() && v < bits.height())) return std::nullopt;
  return bits.at(int(u), int(v));
}

struct Outline {
  std::vector<Normal> normals;
  int passed = 0;  // normals along which the colour continues
};

// Where the colour ends along a normal, from the disc's outline. nullopt: not near it; `passed` is incremented where
// the colour continues. Two misses in a row are an end, one is noise.
std::optional<double> colour_ends(color::MatchBits& bits, const ExpectedDisc& disc, const Eigen::Vector2d& normal,
                                  double window_px, int& passed) {
  const int steps = int(std::ceil(2 * window_px / disc_fit.edge_sigma_px));
  int hits = 0, misses = 0;
  for (int i = 0; i < steps; ++i) {
    const double off = -window_px + (i + 0.5) * disc_fit.edge_sigma_px;
    const auto matches = is_matching(bits, disc.px + (disc.radius_px + off) * normal);
    if (!matches) return std::nullopt;
    if (*matches) {
      hits += 1 + misses;
      misses = 0;
    } else if (++misses == 2) {
      break;
    }
  }
  if (hits >= 2 && misses < 2) ++passed;
  if (hits < 2 || misses < 2) return std::nullopt;  // it ended before, or goes on
  return -window_px + hits * disc_fit.edge_sigma_px;
}

void outline_of(color::MatchBits& bits, std::span<const ExpectedDisc> discs, std::size_t which, double window_px,
                Outline& out) {
  out.normals.clear();
  out.passed = 0;
  const ExpectedDisc& disc = discs[which];
  for (int k = 0; k < disc_fit.directions; ++k) {
    const double angle = 2 * std::numbers::pi * (k + 0.5) / disc_fit.directions;
    const Eigen::Vector2d normal(std::cos(angle), std::sin(angle));
    const Eigen::Vector2d on_outline = disc.px + disc.radius_px * normal;
    const bool is_inside_another = [&] {
      for (std::size_t o = 0; o < discs.size(); ++o) {
        if (o != which && (discs[o].px - on_outline).norm() < discs[o].radius_px + hidden_px) return true;
      }
      return false;
    }();
    if (is_inside_another) continue;
    if (const auto off = colour_ends(bits, disc, normal, window_px, out.passed)) out.normals.push_back({normal, *off});
  }
}

// Unknowns: shift of the centre, change of the radius.
struct Solution {
  Eigen::Vector2d shift;
  Eigen::Matrix2d covariance;
};
Solution solve(std::span<const Normal> outline, const ExpectedDisc& disc) {
  const double radius_sigma = disc_fit.edge_sigma_px + object_tracking::sighting_tuning.shading_share * disc.radius_px;
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  Eigen::Matrix3d information;
  for (int pass = 0; pass < 2; ++pass) {  // the second one with Huber weights
    information.setZero();
    // Prior: 1 sigma of a radius for the shift.
    information.diagonal() << Eigen::Vector2d::Constant(1 / (disc.radius_px * disc.radius_px)),
        1 / (radius_sigma * radius_sigma);
    Eigen::Vector3d vector = Eigen::Vector3d::Zero();
    for (const Normal& n : outline) {
      const Eigen::Vector3d row(n.direction.x(), n.direction.y(), 1);
      const double residual = std::abs(n.off_px - row.dot(x));
      const double weight = pass == 0 ? 1.0 : std::min(1.0, 2 * disc_fit.edge_sigma_px / std::max(residual, 1e-9));
      // Neighbouring points share pixels: two are worth one.
      const double w = 0.5 * weight / (disc_fit.edge_sigma_px * disc_fit.edge_sigma_px);
      information += w * row * row.transpose();
      vector += w * n.off_px * row;
    }
    x = information.llt().solve(vector);
  }
  return {x.head<2>(), information.inverse().topLeftCorner<2, 2>()};
}

}  // namespace

std::vector<std::optional<FittedDisc>> fit_discs(color::MatchBits& bits, std::span<const ExpectedDisc> expected) {
  std::vector<ExpectedDisc> discs(expected.begin(), expected.end());
  std::vector<std::optional<FittedDisc>> out(discs.size());
  Outline outline;
  for (int pass = 0; pass < disc_fit.passes; ++pass) {
    for (std::size_t i = 0; i < discs.size(); ++i) {
      const double slack_px = pass == 0 ? 2 * discs[i].reach_px : 1.0;
      const double window_px = std::min(discs[i].radius_px, 2 + disc_fit.window_share * discs[i].radius_px + slack_px);
      outline_of(bits, discs, i, window_px, outline);
      out[i].reset();
      if (outline.normals.empty()) continue;
      const Solution found = solve(outline.normals, discs[i]);
      discs[i].px += found.shift;
      out[i] = {discs[i].px, found.covariance, double(outline.normals.size()) / disc_fit.directions,
                double(outline.passed) / disc_fit.directions};
    }
  }
  for (std::size_t i = 0; i < discs.size(); ++i) {  // a fit far from the prediction is of another edge
    if (out[i] && (discs[i].px - expected[i].px).norm() >
                      0.5 * discs[i].radius_px + object_tracking::sighting_tuning.prediction_sigmas * discs[i].reach_px)
      out[i].reset();
  }
  return out;
}

}  // namespace huetrack::objects
