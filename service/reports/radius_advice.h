// The advice about a target's radius_m, for every kind of evidence. A measured radius is as right as the rig: where
// views contradict one another, a camera stands elsewhere or times are wrong, nothing is said about the radius
// (MistakeReport::do_views_contradict()).
#pragma once

#include <string>
#include <utility>

#include "object_tracking/tracker_options.h"

namespace huetrack::reports {

// seen_m: the range of true radii, m, that the pictures leave; it does not hold target.radius_m.
std::string radius_advice(std::pair<double, double> seen_m, const object_tracking::TargetOptions& target);

}  // namespace huetrack::reports
