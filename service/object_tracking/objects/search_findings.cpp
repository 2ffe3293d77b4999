#include "object_tracking/objects/search_findings.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "object_tracking/sighting.h"

namespace huetrack::objects {

using namespace object_tracking;

namespace {

struct SearchEvidenceTuning {
  std::size_t min_pairs = 10;         // of regions, from which a radius is stated
  std::size_t min_sets_divisor = 10;  // a camera sees the colour if it does in one of so many frame sets
};
constexpr SearchEvidenceTuning search_evidence{};

// Ratio of two radii of one ball that are measured by its regions: 1 sigma.
double alike() {
  return std::exp(std::numbers::sqrt2 * sighting_tuning.region_size_sigma);
}

// Radius of a ball at p that this region is the image of; 0: none.
double radius_of(const calib::Camera& camera, const color::ColorRegion& region, const Eigen::Vector3d& p) {
  const auto at = project_ball(camera, p, 1.0);
  if (!at || at->radius_px <= 0) return 0;
  const double radius_px = disc_radius(region.area);
  if ((at->px - region.centre).norm() > radius_px) return 0;  // the rays pass each other
  return radius_px / at->radius_px;
}

}  // namespace

void SearchLog::Pairs::add(const Pair& pair) {
  if (all.size() < kept_pairs)
    all.push_back(pair);
  else
    all[next++ % kept_pairs] = pair;
}

std::optional<double> SearchLog::Pairs::radius_m() const {
  if (all.size() < search_evidence.min_pairs) return std::nullopt;
  std::vector<double> sorted;
  for (const Pair& pair : all) sorted.push_back(pair.radius_m);
  std::ranges::sort(sorted);
  const std::size_t n = sorted.size();
  // Chance pairs scatter over decades.
  return are_radii_alike(sorted[3 * n / 4], sorted[n / 4]) ? std::optional(sorted[n / 2]) : std::nullopt;
}

void SearchLog::add(const std::vector<TargetView>& views, std::span<const std::vector<color::ColorRegion>> regions,
                    const Volume& volume, bool is_room_shared) {
  constexpr std::size_t largest = sighting_tuning.max_regions;
  bool is_outside = false;
  for (std::size_t i = 0; i < views.size(); ++i) {
    for (std::size_t j = i + 1; j < views.size(); ++j) {
      const calib::Camera &first = *views[i].camera, &second = *views[j].camera;
      for (const color::ColorRegion& a : std::span(regions[i]).first(std::min(largest, regions[i].size()))) {
        for (const color::ColorRegion& b : std::span(regions[j]).first(std::min(largest, regions[j].size()))) {
          const auto p = crossing(first, {a.centre}, second, {b.centre});
          if (!p) continue;
          const double r = radius_of(first, a, *p), s = radius_of(second, b, *p);
          if (r <= 0 || s <= 0 || !are_radii_alike(r, s)) continue;
          const bool is_inside = inside(volume, *p, 0);
          is_outside |= !is_inside;
          if (is_inside && is_room_shared) continue;
          for (Counted* of : {&since_found_, &of_run_})
            (is_inside ? of->inside : of->outside).add({*p, std::sqrt(r * s)});
        }
      }
    }
  }
  const auto seeing = std::ranges::count_if(regions.first(views.size()), [](const auto& of) { return !of.empty(); });
  for (Counted* of : {&since_found_, &of_run_}) {
    SearchFindings& counts = of->counts;
    ++counts.sets;
    for (std::size_t i = 0; i < views.size(); ++i)
      if (!regions[i].empty()) ++counts.sets_with_color[std::size_t(views[i].index)];
    counts.sets_in_two += seeing >= 2 ? 1 : 0;
    counts.sets_shared += is_room_shared ? 1 : 0;
    counts.sets_outside += is_outside ? 1 : 0;
  }
}

void SearchLog::clear() {
  if (since_found_.counts.sets == 0 && was_found_) return;
  const std::optional<double> before_m = was_found_ ? since_found_.counts.radius_before_m : findings().radius_m;
  since_found_ = Counted(since_found_.counts.sets_with_color.size());
  since_found_.counts.radius_before_m = before_m;
  was_found_ = true;
}

SearchFindings SearchLog::Counted::findings() const {
  SearchFindings out = counts;
  out.radius_m = inside.radius_m();
  const auto radius_m = outside.radius_m();
  if (!radius_m) return out;
  out.outside = {.places = {}, .radius_m = *radius_m};
  std::vector<double> sorted(outside.all.size());
  for (const Eigen::Index axis : {0, 1, 2}) {
    std::ranges::transform(outside.all, sorted.begin(), [axis](const Pair& pair) { return pair.place[axis]; });
    std::ranges::sort(sorted);
    const std::size_t tail = sorted.size() / 20;
    out.outside->places.min()[axis] = sorted[tail];
    out.outside->places.max()[axis] = sorted[sorted.size() - 1 - tail];
  }
  return out;
}

bool SearchFindings::shows_color(std::size_t camera) const {
  return search_evidence.min_sets_divisor * sets_with_color[camera] >= sets;
}

bool are_radii_alike(double a_m, double b_m) {
  return a_m <= alike() * b_m && a_m >= b_m / alike();
}

std::pair<double, double> alike_radii(double radius_m) {
  return {radius_m / alike(), alike() * radius_m};
}

}  // namespace huetrack::objects
