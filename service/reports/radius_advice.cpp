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

}  // namespace huetrack::reports
