// Advice to a user whose target is not found, or was found late, by the evidence of the search.
#pragma once

#include <string>
#include <vector>

#include "object_tracking/objects/search_findings.h"

namespace huetrack::reports {

// What its hue would be in another unit (color_name.h); empty where it cannot be in one, or was taught.
std::string other_unit_text(const object_tracking::TargetOptions& target);

// One sentence; empty when nothing was searched. cameras: their names, in the order of the rig. do_views_contradict:
// MistakeReport's.
std::string search_advice(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target,
                          const std::vector<std::string>& cameras, bool do_views_contradict);
// Of a target without a position in a larger share of the sets in which enough cameras delivered, users want to know
// why.
inline constexpr double most_lost_share = 0.3;
// Where it has none, two views agree on a ball of its colour: outside of the volume, or of another size. If not, it may
// be hidden, and nothing is wrong.
bool is_seen_in_vain(const objects::SearchFindings& of_run, const object_tracking::TargetOptions& target);
// The same, where it is outside of the volume for most of the time that it has none.
bool is_seen_outside(const objects::SearchFindings& of_run, const object_tracking::TargetOptions& target);
// Of a target that has none in this share of them. of_run: of all of them.
std::string lost_advice(double lost_share, const objects::SearchFindings& of_run,
                        const object_tracking::TargetOptions& target, const std::vector<std::string>& cameras,
                        bool do_views_contradict);
// Of a target that was tracked in this share of the sets, 0..1; empty where that is not seldom, or its hue cannot be
// OpenCV's.
std::string seldom_advice(double tracked_share, const object_tracking::TargetOptions& target);
// Of a target that was tracked with a sigma above its radius in this share of those sets, 0..1; empty as above.
std::string unsure_advice(double unsure_share, const object_tracking::TargetOptions& target);
// Of a target that was found, but late; empty where there is no evidence why.
std::string late_advice(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target,
                        bool do_views_contradict);

}  // namespace huetrack::reports
