// The advice about a target's radius_m, for every kind of evidence. A measured radius is as right as the rig: where
// views contradict one another, a camera stands elsewhere or times are wrong, nothing is said about the radius
// (MistakeReport::do_views_contradict()).
#pragma once

#include <optional>
#include <string>
#include <utility>

#include "object_tracking/tracker_options.h"

namespace huetrack::reports {

// seen_m: the range of true radii, m, that the pictures leave; it does not hold target.radius_m.
std::string radius_advice(std::pair<double, double> seen_m, const object_tracking::TargetOptions& target);

// Of a target without a radius_m. shown_m: what is in force instead of the assumed one; nullopt: that is, because the
// outlines agree with it, or have shown none, so that all rests on an assumption.
std::string unset_radius_text(const std::optional<double>& shown_m, bool do_outlines_agree,
                              const object_tracking::TargetOptions& target);

}  // namespace huetrack::reports
