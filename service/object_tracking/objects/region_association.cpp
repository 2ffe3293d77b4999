#include "object_tracking/objects/region_association.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "object_tracking/objects/assignment.h"
#include "object_tracking/objects/disc_fit.h"

namespace huetrack::objects {

using namespace object_tracking;

namespace {

struct RegionAssignmentTuning {
  double max_passed = 0.25;  // share across which the colour goes on: a ball of its size that touches passes 0.1
};
constexpr RegionAssignmentTuning assignment_tuning{};

double sigma_px(const Eigen::Matrix2d& covariance) {
  return std::sqrt(std::max(0.0, 0.5 * covariance.trace()));
}

color::ColorRegion joined(const color::ColorRegion& a, const color::ColorRegion& b) {
  const double n = a.area + b.area;
  const double wa = a.area / n, wb = b.area / n;
  const Eigen::Vector2d d = a.centre - b.centre;
  color::ColorRegion out;
  out.area = a.area + b.area;
  out.centre = wa * a.centre + wb * b.centre;
  out.spread = wa * a.spread + wb * b.spread + wa * wb * d * d.transpose();
  out.box = {std::min(a.box.u_min, b.box.u_min), std::min(a.box.v_min, b.box.v_min), std::max(a.box.u_max, b.box.u_max),
             std::max(a.box.v_max, b.box.v_max)};
  return out;
}

bool overlap(const ExpectedObject& a, const ExpectedObject& b) {
  const double radii = a.at.radius_px + b.at.radius_px;
  const double slack = std::min(2 * (sigma_px(a.covariance) + sigma_px(b.covariance)) + 2, 0.5 * radii);
  return (a.at.px - b.at.px).norm() < radii + slack;
}

// Connected components of overlapping discs.
std::vector<std::vector<std::size_t>> groups_of(std::span<const ExpectedObject> expected) {
  std::vector<std::vector<std::size_t>> out;
  std::vector<char> is_in(expected.size(), 0);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    if (is_in[i] != 0) continue;
    std::vector<std::size_t>& group = out.emplace_back(1, i);
    is_in[i] = 1;
    for (std::size_t next = 0; next < group.size(); ++next) {
      for (std::size_t j = i + 1; j < expected.size(); ++j) {
        if (is_in[j] == 0 && overlap(expected[group[next]], expected[j])) is_in[j] = 1, group.push_back(j);
      }
    }
  }
  return out;
}

// The region has the size and shape of the object's disc.
bool is_whole(const Sighting& by_region, const ExpectedObject& expected) {
  return has_disc_shape(by_region) && !is_too_large_alone(by_region.radius_px, expected.at.radius_px);
}

double d2_of(const Sighting& s, const ExpectedObject& expected) {
  const Eigen::Matrix2d total =
      expected.covariance + s.covariance + s.bias_sigma_px * s.bias_sigma_px * Eigen::Matrix2d::Identity();
  const Eigen::Vector2d d = s.px - expected.at.px;
  return d.dot(total.inverse() * d);
}

}  // namespace

// Global nearest neighbour.
void RegionAssociation::assign(const TargetView& view, std::span<const color::ColorRegion> regions,
                               std::span<const ExpectedObject> expected, AssociatedSightings& out,
                               std::vector<int>& region_of) const {
  const auto n = static_cast<Eigen::Index>(expected.size()), m = static_cast<Eigen::Index>(regions.size());
  Eigen::MatrixXd costs = Eigen::MatrixXd::Constant(n, m, std::numeric_limits<double>::infinity());
  region_of.assign(expected.size(), -1);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const ExpectedObject& e = expected[i];
    for (std::size_t r = 0; r < regions.size(); ++r) {
      const double share = regions[r].area / disc_area(e.at.radius_px);
      if (share < sighting_tuning.min_disc_share ||
          (regions[r].centre - e.at.px).norm() > 2 * sighting_tuning.prediction_sigmas * sigma_px(e.covariance) +
                                                     sighting_tuning.extent_radii * e.at.radius_px)
        continue;
      const Sighting s = sighting_of(view, regions[r], e.at.radius_px, pixel_noise_px_, e.motion);
      const double d2 = d2_of(s, e);
      if (d2 > sighting_tuning.gate_nis) continue;
      costs(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(r)) =
          d2 + std::log(s.covariance.determinant()) - 2 * std::log(s.support);
    }
  }
  bool is_shared = false;
  std::vector<char> is_taken(regions.size(), 0);
  for (std::size_t i = 0; i < expected.size() && m > 0; ++i) {
    Eigen::Index best = 0;
    if (!std::isfinite(costs.row(static_cast<Eigen::Index>(i)).minCoeff(&best))) continue;
    region_of[i] = int(best);
    is_shared = is_shared || is_taken[std::size_t(best)] != 0;
    is_taken[std::size_t(best)] = 1;
  }
  if (is_shared) {
    // From 0; an object without a region costs more than any assignment of all others.
    costs.array() -= costs.minCoeff();
    double most = 0;
    for (const double cost : costs.reshaped())
      if (std::isfinite(cost)) most = std::max(most, cost);
    region_of = assignment_of(costs, static_cast<double>(n) * most + 1);
  }
  for (const int r : region_of) {
    if (r >= 0) out.is_explained[std::size_t(r)] = 1;
  }
}

std::optional<Sighting> RegionAssociation::by_outline(const TargetView& view, const ExpectedObject& expected,
                                                      const std::optional<FittedDisc>& fitted) const {
  if (!fitted || fitted->seen < sighting_tuning.min_disc_share || fitted->passed > assignment_tuning.max_passed)
    return std::nullopt;
  const double radius_px = expected.at.radius_px;
  const BaseError usual = base_error(radius_px, pixel_noise_px_, sample_px(*view.image));
  Sighting s;
  s.row.camera = view.index;
  s.camera = view.camera;
  s.projector = view.projector;
  s.px = fitted->px;
  s.covariance = fitted->covariance + usual.noise_px2 * Eigen::Matrix2d::Identity();
  s.bias_sigma_px = std::sqrt(usual.bias_px2);
  s.support = fitted->seen;
  s.radius_px = radius_px;
  if (d2_of(s, expected) > sighting_tuning.gate_nis) return std::nullopt;
  return s;
}

// The region joined with its neighbours: a pole in front of a ball cuts it in two.
Sighting RegionAssociation::by_region(const TargetView& view, std::span<const color::ColorRegion> regions,
                                      std::size_t which, const ExpectedObject& expected,
                                      AssociatedSightings& out) const {
  color::ColorRegion region = regions[which];
  for (std::size_t r = 0; r < regions.size(); ++r) {
    if (out.is_explained[r] != 0 ||
        (regions[r].centre - region.centre).norm() > sighting_tuning.part_radii * expected.at.radius_px ||
        region.area + regions[r].area > sighting_tuning.alone_share * disc_area(expected.at.radius_px))
      continue;
    region = joined(region, regions[r]);
    out.is_explained[r] = 1;
  }
  return sighting_of(view, region, expected.at.radius_px, pixel_noise_px_, expected.motion);
}

AssociatedSightings RegionAssociation::associate(const TargetView& view, std::span<const color::ColorRegion> regions,
                                                 std::span<const ExpectedObject> expected) const {
  AssociatedSightings out;
  out.of_objects.resize(expected.size());
  out.is_explained.assign(regions.size(), 0);
  if (expected.empty()) return out;
  std::vector<int> region_of;
  assign(view, regions, expected, out, region_of);
  std::vector<std::size_t> in_part;
  std::vector<ExpectedDisc> discs;
  for (const std::vector<std::size_t>& group : groups_of(expected)) {
    in_part.clear();
    for (const std::size_t i : group) {
      bool is_by_region = false;
      if (region_of[i] >= 0) {
        out.of_objects[i] = by_region(view, regions, std::size_t(region_of[i]), expected[i], out);
        // Not if another object may occlude it, whose region this would be.
        const bool is_alone = std::ranges::none_of(group, [&](std::size_t o) {
          return o != i && (expected[o].at.px - expected[i].at.px).norm() <
                               std::max(expected[o].at.radius_px, expected[i].at.radius_px);
        });
        is_by_region = is_alone && is_whole(*out.of_objects[i], expected[i]);
      }
      if (!is_by_region) in_part.push_back(i);
    }
    if (in_part.empty()) continue;
    // Touching or occluded discs: all outlines of the group together.
    discs.clear();
    for (const std::size_t i : group)
      discs.push_back({expected[i].at.px, expected[i].at.radius_px,
                       std::min(sigma_px(expected[i].covariance), 0.5 * expected[i].at.radius_px)});
    const auto fitted = fit_discs(*view.matches, discs);
    for (const std::size_t i : in_part) {
      const auto place = std::size_t(std::ranges::find(group, i) - group.begin());
      std::optional<Sighting>& sighting = out.of_objects[i];
      if (auto outline = by_outline(view, expected[i], fitted[place])) {
        sighting = std::move(outline);
      } else if (group.size() > 1 && !(sighting && is_whole(*sighting, expected[i]))) {
        sighting.reset();  // the region is not this object's alone
      }
    }
  }
  // Regions within a detected object are explained by it.
  for (std::size_t r = 0; r < regions.size(); ++r) {
    for (std::size_t i = 0; i < expected.size() && out.is_explained[r] == 0; ++i) {
      if (!out.of_objects[i]) continue;
      const Eigen::Vector2d& px = out.of_objects[i]->px;
      const Eigen::Vector2d nearest(std::clamp(px.x(), regions[r].box.u_min - 0.5, regions[r].box.u_max + 0.5),
                                    std::clamp(px.y(), regions[r].box.v_min - 0.5, regions[r].box.v_max + 0.5));
      const bool is_near = (regions[r].centre - px).norm() < sighting_tuning.part_radii * expected[i].at.radius_px;
      const bool is_around = (nearest - px).norm() < 0.5 * expected[i].at.radius_px;
      if (is_near || is_around) out.is_explained[r] = 1;
    }
  }
  return out;
}

}  // namespace huetrack::objects
