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

void SearchLog::add(const std::vector<TargetView>& views, std::span<const std::vector<color::ColorRegion>> regions,
                    const Volume& volume) {
  constexpr std::size_t largest = sighting_tuning.max_regions;
  ++findings_.sets;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (!regions[i].empty()) ++findings_.sets_with_color[std::size_t(views[i].index)];
    for (std::size_t j = i + 1; j < views.size(); ++j) {
      const calib::Camera &first = *views[i].camera, &second = *views[j].camera;
      for (const color::ColorRegion& a : std::span(regions[i]).first(std::min(largest, regions[i].size()))) {
        for (const color::ColorRegion& b : std::span(regions[j]).first(std::min(largest, regions[j].size()))) {
          const auto p = crossing(first, {a.centre}, second, {b.centre});
          if (!p || !inside(volume, *p, 0)) continue;
          const double r = radius_of(first, a, *p), s = radius_of(second, b, *p);
          if (r <= 0 || s <= 0 || !are_radii_alike(r, s)) continue;
          if (radii_m_.size() < kept_radii)
            radii_m_.push_back(std::sqrt(r * s));
          else
            radii_m_[next_++ % kept_radii] = std::sqrt(r * s);
        }
      }
    }
  }
}

void SearchLog::clear() {
  if (findings_.sets == 0 && was_found_) return;
  const std::optional<double> before_m = was_found_ ? findings_.radius_before_m : findings().radius_m;
  *this = SearchLog(findings_.sets_with_color.size());
  findings_.radius_before_m = before_m;
  was_found_ = true;
}

SearchFindings SearchLog::findings() const {
  SearchFindings out = findings_;
  if (radii_m_.size() < search_evidence.min_pairs) return out;
  std::vector<double> sorted = radii_m_;
  std::ranges::sort(sorted);
  const std::size_t n = sorted.size();
  // Chance pairs scatter over decades.
  if (are_radii_alike(sorted[3 * n / 4], sorted[n / 4])) out.radius_m = sorted[n / 2];
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
