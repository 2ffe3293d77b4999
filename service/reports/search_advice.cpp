#include "reports/search_advice.h"

#include <fmt/format.h>

#include "color/color_name.h"
#include "reports/radius_advice.h"

namespace huetrack::reports {

namespace {

std::string size_advice(const std::optional<double>& radius_m, const object_tracking::TargetOptions& target) {
  if (!radius_m || objects::are_radii_alike(*radius_m, target.radius_m)) return {};
  return radius_advice(objects::alike_radii(*radius_m), target);
}

std::string what_to_try(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target,
                        const std::vector<std::string>& cameras, bool do_views_contradict) {
  std::vector<std::string> seeing, blind;
  for (std::size_t c = 0; c < findings.sets_with_color.size() && c < cameras.size(); ++c)
    (findings.shows_color(c) ? seeing : blind).push_back(cameras[c]);
  if (std::string of_size = size_advice(findings.radius_m, target); !of_size.empty() && !do_views_contradict)
    return of_size;
  if (seeing.empty()) return "no camera shows a region of its colour: widen its colour, or check the volume";
  if (!blind.empty())
    return fmt::format("its colour is seen by {} but hardly ever by {}: set camera_colors for these",
                       fmt::join(seeing, ", "), fmt::join(blind, ", "));
  if (cameras.size() == 1)
    return target.shape == object_tracking::TargetShape::blob
               ? "a blob's distance takes two cameras: with one, only balls are found (shape: ball or auto)"
               : "no round region of its colour has a size that gives a distance inside the volume: check the radius, "
                 "the volume and the colour";
  if (do_views_contradict)
    return "all cameras show regions of its colour, but the views contradict one another: correct the calibration "
           "first";
  return "all cameras show regions of its colour, but their rays do not meet in the volume where a ball of its radius "
         "would look so: check the calibration and the radius, or narrow its colour";
}

}  // namespace

std::string search_advice(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target,
                          const std::vector<std::string>& cameras, bool do_views_contradict) {
  if (findings.sets == 0) return {};
  const std::string opencv = color::other_unit_text(target.color);
  return what_to_try(findings, target, cameras, do_views_contradict) + "; " + color::hue_text(target.color) +
         (opencv.empty() ? "" : "; ") + opencv;
}

std::string seldom_advice(double tracked_share, const object_tracking::TargetOptions& target) {
  constexpr double seldom = 0.25;  // clutter of another colour range is tracked for moments
  const std::string opencv = color::other_unit_text(target.color);
  if (tracked_share >= seldom || opencv.empty()) return {};
  return fmt::format("it was tracked in only {:.0f} % of the sets, and may be something else; {}; {}",
                     100 * tracked_share, color::hue_text(target.color), opencv);
}

std::string unsure_advice(double unsure_share, const object_tracking::TargetOptions& target) {
  // Two cameras locate a ball to a part of its radius: the sigma is above it in 1.3 % of the sets at most where the
  // colour is right, and in 96 % where it is another object's (shared recordings).
  constexpr double usual = 0.5;
  const std::string opencv = color::other_unit_text(target.color);
  if (unsure_share <= usual || opencv.empty()) return {};
  return fmt::format(
      "its sigma was above its radius, {:g} mm, in {:.0f} % of the sets in which it was tracked, so it may be "
      "something else; {}; {}",
      1e3 * target.radius_m, 100 * unsure_share, color::hue_text(target.color), opencv);
}

std::string late_advice(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target,
                        bool do_views_contradict) {
  if (do_views_contradict) return "";
  const std::string of_size = size_advice(findings.radius_before_m, target);
  return of_size.empty() ? "" : "it was found late: " + of_size;
}

}  // namespace huetrack::reports
