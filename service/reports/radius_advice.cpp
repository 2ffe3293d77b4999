#include "reports/radius_advice.h"

#include <fmt/format.h>

namespace huetrack::reports {

std::string radius_advice(std::pair<double, double> seen_m, const object_tracking::TargetOptions& target) {
  const bool is_seen_larger = seen_m.first > target.radius_m;
  return fmt::format(
      "the pictures of {0} show a radius of {1:.2g} to {2:.2g} m, not {3:.3g}: measure it, and correct radius_m; if "
      "{3:.3g} m is right, the rig's scale is wrong, or its colour is too {4}",
      target.name, seen_m.first, seen_m.second, target.radius_m, is_seen_larger ? "wide" : "narrow");
}

std::string unset_radius_text(const std::optional<double>& shown_m, bool do_outlines_agree,
                              const object_tracking::TargetOptions& target) {
  if (shown_m)
    return fmt::format("no radius is set: {:.3g} m was assumed until the pictures showed {:.3g} m: set radius_m",
                       target.radius_m, *shown_m);
  if (do_outlines_agree)
    return fmt::format("no radius is set: {:.3g} m is assumed, which its outlines do not contradict: set radius_m",
                       target.radius_m);
  return fmt::format(
      "no radius of {} is set, and its outlines show none: {:.3g} m is assumed, and its positions and the cameras' "
      "times are as wrong as that is: measure it, and set radius_m",
      target.name, target.radius_m);
}

}  // namespace huetrack::reports
