#include "object_tracking/objects/search_findings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "object_tracking/sighting.h"

namespace huetrack::objects {

using namespace object_tracking;

namespace {

struct SearchEvidenceTuning {
  double alike = 1.3;                 // ratio of two radii of one ball: half the area wrong is a quarter of the radius
  double meeting_px = 1.5;            // px from a crossing's projection to the region's centre, at most
  double meeting_radii = 0.3;         // radii, in addition
  std::size_t max_regions = 3;        // per view, the largest ones: an object, not specks
  std::size_t min_pairs = 10;         // of regions, from which a radius is stated
  double max_quartiles = 1.5;         // ratio of the radii's quartiles: chance pairs scatter over decades
  std::size_t min_sets_divisor = 10;  // a camera sees the colour if it does in one of so many frame sets
};
constexpr SearchEvidenceTuning search_evidence{};

// What to do about the radius, or the colour, of what was searched for and showed a radius; empty: they are alike.
std::string size_advice(const std::optional<double>& radius_m, const TargetOptions& target) {
  if (!radius_m ||
      (*radius_m <= search_evidence.alike * target.radius_m && *radius_m >= target.radius_m / search_evidence.alike))
    return {};
  return fmt::format(
      "what has its colour has the size of a ball of radius {:.3g} m, not {:.3g}: correct radius_m, or {} its colour",
      *radius_m, target.radius_m, *radius_m > target.radius_m ? "narrow" : "widen");
}

// The radius of the ball that shows this region at p; 0: none.
double radius_of(const calib::Camera& camera, const color::ColorRegion& region, const Eigen::Vector3d& p) {
  const auto at = appearance_of(camera, p, 1.0);
  if (!at || at->radius_px <= 0) return 0;
  const double radius_px = std::sqrt(region.area / std::numbers::pi);
  if ((at->px - region.centre).norm() > search_evidence.meeting_px + search_evidence.meeting_radii * radius_px)
    return 0;  // the rays pass each other
  return radius_px / at->radius_px;
}

}  // namespace

void SearchLog::add(const std::vector<TargetView>& views, std::span<const std::vector<color::ColorRegion>> regions,
                    const Volume& volume) {
  constexpr std::size_t largest = search_evidence.max_regions;
  ++findings_.sets;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (!regions[i].empty()) ++findings_.sets_with_color[static_cast<std::size_t>(views[i].index)];
    for (std::size_t j = i + 1; j < views.size(); ++j) {
      const calib::Camera &first = *views[i].camera, &second = *views[j].camera;
      for (const color::ColorRegion& a : std::span(regions[i]).first(std::min(largest, regions[i].size()))) {
        for (const color::ColorRegion& b : std::span(regions[j]).first(std::min(largest, regions[j].size()))) {
          const auto p = crossing(first, {a.centre}, second, {b.centre});
          if (!p || !inside(volume, *p, 0)) continue;
          const double r = radius_of(first, a, *p), s = radius_of(second, b, *p);
          if (r <= 0 || s <= 0 || std::max(r, s) > search_evidence.alike * std::min(r, s)) continue;
          if (radii_m_.size() < search_log.kept_radii)
            radii_m_.push_back(std::sqrt(r * s));
          else
            radii_m_[next_++ % search_log.kept_radii] = std::sqrt(r * s);
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
  if (sorted[3 * n / 4] <= search_evidence.max_quartiles * sorted[n / 4]) out.radius_m = sorted[n / 2];
  return out;
}

std::string SearchFindings::advice(const TargetOptions& target, const std::vector<std::string>& cameras) const {
  if (is_found_at_twice_the_hue)
    return fmt::format(
        "something of twice its hue moves as it would: are hue_deg [{:.0f}, {:.0f}] OpenCV's units (0 to 180)? Here "
        "they "
        "are degrees (0 to 360): write [{:.0f}, {:.0f}]",
        target.color.hue_min_deg, target.color.hue_max_deg, 2 * target.color.hue_min_deg, 2 * target.color.hue_max_deg);
  if (sets == 0) return {};
  std::vector<std::string> seeing, blind;
  for (std::size_t c = 0; c < sets_with_color.size() && c < cameras.size(); ++c)
    (search_evidence.min_sets_divisor * sets_with_color[c] >= sets ? seeing : blind).push_back(cameras[c]);
  if (std::string of_size = size_advice(radius_m, target); !of_size.empty()) return of_size;
  if (seeing.empty()) return "no camera shows a region of its colour: widen its colour, or check the volume";
  if (!blind.empty())
    return fmt::format("its colour is seen by {} but hardly ever by {}: set camera_colors for these",
                       fmt::join(seeing, ", "), fmt::join(blind, ", "));
  return "all cameras show regions of its colour, but their rays do not meet in the volume where a ball of its radius "
         "would look so: check the calibration and the radius, or narrow its colour";
}

std::string SearchFindings::late_advice(const TargetOptions& target) const {
  const std::string of_size = size_advice(radius_before_m, target);
  return of_size.empty() ? "" : "it was found late: " + of_size;
}

}  // namespace huetrack::objects
