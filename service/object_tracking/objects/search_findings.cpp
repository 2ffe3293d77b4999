#include "object_tracking/objects/search_findings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "color/color_name.h"
#include "object_tracking/sighting.h"

namespace huetrack::objects {

using namespace object_tracking;

namespace {

// Two views' sizes of one ball, or what is found and what was said, are alike within this: where a region's area is off
// by a half, its radius is by a quarter.
constexpr double alike = 1.3;

// What to do about the radius, or the colour, of what was searched for and showed a radius; empty: they are alike.
std::string size_advice(const std::optional<double>& radius_m, const TargetOptions& target) {
  if (!radius_m || (*radius_m <= alike * target.radius_m && *radius_m >= target.radius_m / alike)) return {};
  return fmt::format(
      "what has its colour has the size of a ball of radius {:.3g} m, not {:.3g}: correct radius_m, or {} its colour",
      *radius_m, target.radius_m, *radius_m > target.radius_m ? "narrow" : "widen");
}

std::string what_to_try(const SearchFindings& found, const TargetOptions& target,
                        const std::vector<std::string>& cameras) {
  std::vector<std::string> seeing, blind;
  for (std::size_t c = 0; c < found.sets_with_color.size() && c < cameras.size(); ++c)
    (10 * found.sets_with_color[c] >= found.sets ? seeing : blind).push_back(cameras[c]);
  if (std::string of_size = size_advice(found.radius_m, target); !of_size.empty()) return of_size;
  if (seeing.empty()) return "no camera shows a region of its colour: widen its colour, or check the volume";
  if (!blind.empty())
    return fmt::format("its colour is seen by {} but hardly ever by {}: set camera_colors for these",
                       fmt::join(seeing, ", "), fmt::join(blind, ", "));
  return "all cameras show regions of its colour, but their rays do not meet in the volume where a ball of its radius "
         "would look so: check the calibration and the radius, or narrow its colour";
}

// The radius of the ball that shows this region at p; 0: none.
double radius_of(const calib::Camera& camera, const color::ColorRegion& region, const Eigen::Vector3d& p) {
  const auto at = project_ball(camera, p, 1.0);
  if (!at || at->radius_px <= 0) return 0;
  const double radius_px = std::sqrt(region.area / std::numbers::pi);
  if ((at->px - region.centre).norm() > 1.5 + 0.3 * radius_px) return 0;  // the rays pass each other
  return radius_px / at->radius_px;
}

}  // namespace

void SearchLog::add(const std::vector<TargetView>& views, std::span<const std::vector<color::ColorRegion>> regions,
                    const Volume& volume) {
  constexpr std::size_t largest = 3;  // regions per view; what is asked for is an object, not specks
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
          if (r <= 0 || s <= 0 || std::max(r, s) > alike * std::min(r, s)) continue;
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
  constexpr std::size_t enough = 10;
  if (radii_m_.size() < enough) return out;
  std::vector<double> sorted = radii_m_;
  std::ranges::sort(sorted);
  const std::size_t n = sorted.size();
  // Of one object: chance pairs of background regions scatter over decades.
  constexpr double of_one_object = 1.5;  // between the quartiles
  if (sorted[3 * n / 4] <= of_one_object * sorted[n / 4]) out.radius_m = sorted[n / 2];
  return out;
}

std::string SearchFindings::advice(const TargetOptions& target, const std::vector<std::string>& cameras) const {
  if (sets == 0) return {};
  const std::string opencv = color::opencv_hue_text(target.color);
  return what_to_try(*this, target, cameras) + "; " + color::hue_text(target.color) + (opencv.empty() ? "" : "; ") +
         opencv;
}

std::string SearchFindings::late_advice(const TargetOptions& target) const {
  const std::string of_size = size_advice(radius_before_m, target);
  return of_size.empty() ? "" : "it was found late: " + of_size;
}

}  // namespace huetrack::objects
