#include "reports/search_advice.h"

#include <fmt/format.h>

#include <cmath>

#include "color/color_name.h"
#include "reports/radius_advice.h"

namespace huetrack::reports {

std::string other_unit_text(const object_tracking::TargetOptions& target) {
  return target.is_hue_taught ? std::string() : color::other_unit_text(target.color);
}

namespace {

// What its hue would be if red and blue were swapped where it was measured.
std::string swapped_text(const object_tracking::TargetOptions& target) {
  const color::HsiRange& range = target.color;
  if (target.is_hue_taught || color::is_share_of_circle(range) || color::hue_width_deg(range) >= 360) return {};
  color::HsiRange swapped = range;  // mirrored at green, 120 degrees
  swapped.hue_min_deg = std::fmod(600 - range.hue_max_deg, 360);
  swapped.hue_max_deg = std::fmod(600 - range.hue_min_deg, 360);
  return "; if red and blue were swapped where it was measured (BGR for RGB): " + color::hue_text(swapped);
}

std::string size_advice(const std::optional<double>& radius_m, const object_tracking::TargetOptions& target) {
  if (!radius_m || objects::are_radii_alike(*radius_m, target.radius_m)) return {};
  return radius_advice(objects::alike_radii(*radius_m), target);
}

std::string place_text(const Eigen::Vector3d& p) {
  return fmt::format("{:.2f}, {:.2f}, {:.2f}", p.x(), p.y(), p.z());
}

// In most sets the ball is where nothing is searched for; empty: it is not.
std::string outside_advice(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target) {
  if (!findings.outside || 2 * findings.sets_outside < findings.sets ||
      !objects::are_radii_alike(findings.outside->radius_m, target.radius_m))
    return {};
  return fmt::format(
      "in {:.0f} % of these sets two cameras see a ball of its colour and size outside of object_tracking.volume, at "
      "x, y, z from {} to {} m: extend the volume to there",
      100 * double(findings.sets_outside) / double(findings.sets), place_text(findings.outside->places.min()),
      place_text(findings.outside->places.max()));
}

std::string what_to_try(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target,
                        const std::vector<std::string>& cameras, bool do_views_contradict, bool is_found_at_times) {
  std::vector<std::string> seeing, blind;
  for (std::size_t c = 0; c < findings.sets_with_color.size() && c < cameras.size(); ++c)
    (findings.shows_color(c) ? seeing : blind).push_back(cameras[c]);
  if (std::string of_size = size_advice(findings.radius_m, target); !of_size.empty() && !do_views_contradict)
    return of_size;
  if (seeing.empty()) return "no camera shows a region of its colour: widen its colour, or check the volume";
  if (!blind.empty())
    return fmt::format("its colour is seen by {} but hardly ever by {}: set camera_colors for these",
                       fmt::join(seeing, ", "), fmt::join(blind, ", "));
  if (cameras.size() == 1 && target.shape == object_tracking::TargetShape::blob)
    return "a blob's distance takes two cameras: with one, only balls are found (shape: ball or auto)";
  if (cameras.size() == 1 && 2 * findings.sets_shared > findings.sets)
    return fmt::format(
        "the picture shows more of its colour, or more spots of it, than one ball has, so that its size, and with one "
        "camera its distance, cannot be read: narrow its colour, first of all its saturation, [{:g}, {:g}] now",
        target.color.saturation_min, target.color.saturation_max);
  if (cameras.size() == 1)
    return "no round region of its colour has a size that gives a distance inside the volume: check the radius, the "
           "volume and the colour";
  if (2 * findings.sets_in_two < findings.sets)
    return fmt::format(
        "two cameras see its colour at once in only {:.0f} % of these sets, and a position takes two: widen its "
        "colour, or turn the cameras to where it is",
        100 * double(findings.sets_in_two) / double(findings.sets));
  if (do_views_contradict)
    return "all cameras show regions of its colour, but the views contradict one another: the other "
           "warnings say why: correct that first";
  if (is_found_at_times)
    return "all cameras show regions of its colour, but these are no ball of its size in the volume: it is hidden, and "
           "other things have its colour: narrow the colour, or turn a camera to where it is hidden";
  return "all cameras show regions of its colour, but their rays do not meet in the volume where a ball of its radius "
         "would look so: check the time stamps, the calibration and the radius, or narrow its colour";
}

std::string advice(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target,
                   const std::vector<std::string>& cameras, bool do_views_contradict, bool is_found_at_times) {
  if (findings.sets == 0) return {};
  // Seen in its colour and size: neither is in question.
  if (std::string of_volume = outside_advice(findings, target); !of_volume.empty() && !do_views_contradict)
    return of_volume;
  bool is_unseen = true;
  for (std::size_t c = 0; c < findings.sets_with_color.size(); ++c) is_unseen &= !findings.shows_color(c);
  const std::string opencv = is_found_at_times ? "" : other_unit_text(target);  // its hue is right
  return what_to_try(findings, target, cameras, do_views_contradict, is_found_at_times) + "; " +
         color::hue_text(target.color) + (opencv.empty() ? "" : "; ") + opencv +
         (is_unseen && !is_found_at_times ? swapped_text(target) : "");
}

}  // namespace

std::string search_advice(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target,
                          const std::vector<std::string>& cameras, bool do_views_contradict) {
  return advice(findings, target, cameras, do_views_contradict, false);
}

bool is_seen_outside(const objects::SearchFindings& of_run, const object_tracking::TargetOptions& target) {
  return !outside_advice(of_run, target).empty();
}

bool is_seen_in_vain(const objects::SearchFindings& of_run, const object_tracking::TargetOptions& target) {
  return is_seen_outside(of_run, target) || !size_advice(of_run.radius_m, target).empty();
}

std::string lost_advice(double lost_share, const objects::SearchFindings& of_run,
                        const object_tracking::TargetOptions& target, const std::vector<std::string>& cameras,
                        bool do_views_contradict) {
  const std::string why = advice(of_run, target, cameras, do_views_contradict, true);
  return fmt::format("it has no position in {:.0f} % of the sets in which enough cameras delivered{}{}",
                     100 * lost_share, why.empty() ? "" : "; there ", why);
}

std::string seldom_advice(double tracked_share, const object_tracking::TargetOptions& target) {
  constexpr double seldom = 0.25;  // clutter of another colour range is tracked for moments
  const std::string opencv = other_unit_text(target);
  if (tracked_share >= seldom || opencv.empty()) return {};
  return fmt::format("it was tracked in only {:.0f} % of the sets, and may be something else; {}; {}",
                     100 * tracked_share, color::hue_text(target.color), opencv);
}

std::string unsure_advice(double unsure_share, const object_tracking::TargetOptions& target) {
  // Two cameras locate a ball to a part of its radius: the sigma is above it in 1.3 % of the sets at most where the
  // colour is right, and in 96 % where it is another object's (shared recordings).
  constexpr double usual = 0.5;
  const std::string opencv = other_unit_text(target);
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
