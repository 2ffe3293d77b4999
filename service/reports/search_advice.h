// Advice to a user whose target is not found, or was found late, by the evidence of the search.
#pragma once

#include <string>
#include <vector>

#include "object_tracking/objects/search_findings.h"

namespace huetrack::reports {

// One sentence; empty when nothing was searched. cameras: their names, in the order of the rig. do_views_contradict:
// MistakeReport's.
std::string search_advice(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target,
                          const std::vector<std::string>& cameras, bool do_views_contradict);
// Of a target that was tracked in this share of the sets, 0..1; empty where that is not seldom, or its hue cannot be
// OpenCV's.
std::string seldom_advice(double tracked_share, const object_tracking::TargetOptions& target);
// Of a target that was tracked with a sigma above its radius in this share of those sets, 0..1; empty as above.
std::string unsure_advice(double unsure_share, const object_tracking::TargetOptions& target);
// Of a target that was found, but late; empty where there is no evidence why.
std::string late_advice(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target,
                        bool do_views_contradict);

}  // namespace huetrack::reports
