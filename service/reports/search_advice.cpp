#include "reports/search_advice.h"

#include <fmt/format.h>

#include "color/color_name.h"

namespace huetrack::reports {

namespace {

std::string size_advice(const std::optional<double>& radius_m, const object_tracking::TargetOptions& target) {
  if (!radius_m || objects::are_radii_alike(*radius_m, target.radius_m)) return {};
  return fmt::format(
      "what has its colour has the size of a ball of radius {:.3g} m, not {:.3g}: correct radius_m, or {} its colour",
      *radius_m, target.radius_m, *radius_m > target.radius_m ? "narrow" : "widen");
}

std::string what_to_try(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target,
                        const std::vector<std::string>& cameras) {
  std::vector<std::string> seeing, blind;
  for (std::size_t c = 0; c < findings.sets_with_color.size() && c < cameras.size(); ++c)
    (findings.shows_color(c) ? seeing : blind).push_back(cameras[c]);
  if (std::string of_size = size_advice(findings.radius_m, target); !of_size.empty()) return of_size;
  if (seeing.empty()) return "no camera shows a region of its colour: widen its colour, or check the volume";
  if (!blind.empty())
    return fmt::format("its colour is seen by {} but hardly ever by {}: set camera_colors for these",
                       fmt::join(seeing, ", "), fmt::join(blind, ", "));
  if (cameras.size() == 1)
    return target.shape == object_tracking::TargetShape::blob
               ? "a blob's distance takes two cameras: with one, only balls are found (shape: ball or auto)"
               : "no round region of its colour has a size that gives a distance inside the volume: check the radius, "
                 "the "
                 "volume and the colour";
  return "all cameras show regions of its colour, but their rays do not meet in the volume where a ball of its radius "
         "would look so: check the calibration and the radius, or narrow its colour";
}

}  // namespace

std::string search_advice(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target,
                          const std::vector<std::string>& cameras) {
  if (findings.sets == 0) return {};
  const std::string opencv = color::opencv_hue_text(target.color);
  return what_to_try(findings, target, cameras) + "; " + color::hue_text(target.color) + (opencv.empty() ? "" : "; ") +
         opencv;
}

std::string seldom_advice(double tracked_share, const object_tracking::TargetOptions& target) {
  constexpr double seldom = 0.25;  // clutter of another colour range is tracked for moments
  const std::string opencv = color::opencv_hue_text(target.color);
  if (tracked_share >= seldom || opencv.empty()) return {};
  return fmt::format("it was tracked in only {:.0f} % of the sets, and may be something else; {}; {}",
                     100 * tracked_share, color::hue_text(target.color), opencv);
}

std::string late_advice(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target) {
  const std::string of_size = size_advice(findings.radius_before_m, target);
  return of_size.empty() ? "" : "it was found late: " + of_size;
}

}  // namespace huetrack::reports
